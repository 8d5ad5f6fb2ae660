# Installs the build tree into a fresh prefix, then builds and runs a project that uses it.
cmake_minimum_required(VERSION 3.25)

foreach(name IN ITEMS build_dir config work_dir configs_dir bin data generator compiler architecture_test)
  if("${${name}}" STREQUAL "")
    message(FATAL_ERROR "install test: give -D ${name}=...")
  endif()
endforeach()

function(run)
  list(JOIN ARGN " " command)
  message(STATUS "${command}")
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "exit ${code}: ${command}")
  endif()
endfunction()

# The caller's own DESTDIR would move everything away from the prefix.
unset(ENV{DESTDIR})
set(prefix "${work_dir}/prefix")
file(REMOVE_RECURSE "${work_dir}")
run(${CMAKE_COMMAND} --install "${build_dir}" --config ${config} --prefix "${prefix}")

# No program or library looks for another in the current folder.
run(${CMAKE_COMMAND} -E env "THICKLENS_INSTALLED=${prefix}" "${architecture_test}"
    --gtest_filter=ElfSearchPaths.*)

run("${prefix}/${bin}/thicklens" --help)
# What it loads itself is not on the system's search path.
run("${prefix}/${bin}/thicklens" doctor --device cpu)
file(GLOB_RECURSE configs RELATIVE "${configs_dir}" "${configs_dir}/*.yaml")
if(NOT configs)
  message(FATAL_ERROR "there is no configuration in ${configs_dir}")
endif()
foreach(file IN LISTS configs)
  if(NOT EXISTS "${prefix}/${data}/${file}")
    message(FATAL_ERROR "not installed: ${prefix}/${data}/${file}")
  endif()
endforeach()

run(${CMAKE_COMMAND} -S "${CMAKE_CURRENT_LIST_DIR}/consumer" -B "${work_dir}/consumer"
    -G "${generator}" -D CMAKE_BUILD_TYPE=${config} -D CMAKE_CXX_COMPILER=${compiler}
    -D "CMAKE_PREFIX_PATH=${prefix}")
run(${CMAKE_COMMAND} --build "${work_dir}/consumer" --config ${config})
run("${work_dir}/consumer/consumer")
