# Installs the build tree into a fresh prefix, then builds and runs a project that uses it.
cmake_minimum_required(VERSION 3.25)

foreach(name IN ITEMS build_dir config work_dir configs_dir bin data generator compiler architecture_test
                       internal_headers)
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

# A DESTDIR of the caller would move the files away from the prefix.
unset(ENV{DESTDIR})
set(prefix "${work_dir}/prefix")
file(REMOVE_RECURSE "${work_dir}")
run(${CMAKE_COMMAND} --install "${build_dir}" --config ${config} --prefix "${prefix}")

# No program or library looks for another in the current folder.
run(${CMAKE_COMMAND} -E env "THICKLENS_INSTALLED=${prefix}" "${architecture_test}"
    --gtest_filter=ElfSearchPaths.*)

run("${prefix}/${bin}/thicklens" --help)
# The library that the program loads is not on the system's search path.
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

# run_consumer(<folder> <options for CMake...>): builds the project with the package, and runs its
# programs, of which each links all libraries or only one.
function(run_consumer folder)
  run(${CMAKE_COMMAND} -S "${CMAKE_CURRENT_LIST_DIR}/consumer" -B "${folder}" -G "${generator}"
      -D CMAKE_BUILD_TYPE=${config} -D CMAKE_CXX_COMPILER=${compiler} ${ARGN})
  run(${CMAKE_COMMAND} --build "${folder}" --config ${config})
  foreach(program IN ITEMS consumer only_base only_model only_kernels only_calib only_estimator only_io
                           only_thicklens)
    run(${CMAKE_COMMAND} -E chdir "${folder}" "./${program}")
  endforeach()
endfunction()
run_consumer("${work_dir}/consumer" -D "CMAKE_PREFIX_PATH=${prefix}")

# No internal header is installed.
file(STRINGS "${internal_headers}" headers)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "^.*/include/" "" header "${header}")
  if(EXISTS "${prefix}/include/${header}")
    message(FATAL_ERROR "installed, but internal: ${header}")
  endif()
endforeach()

# The same with the shared libraries, in a prefix of their own so that no static one can be linked.
if(shared)
  set(shared_prefix "${work_dir}/shared_prefix")
  run(${CMAKE_COMMAND} --install "${build_dir}" --config ${config} --component thicklens_shared
      --prefix "${shared_prefix}")
  run(${CMAKE_COMMAND} -E env "THICKLENS_INSTALLED=${shared_prefix}" "${architecture_test}"
      --gtest_filter=ElfSearchPaths.*)
  file(GLOB_RECURSE config_file "${shared_prefix}/thicklensConfig.cmake")
  cmake_path(GET config_file PARENT_PATH config_dir)
  run_consumer("${work_dir}/shared_consumer" -D "thicklens_DIR=${config_dir}")
endif()

# The documents that the comments of the headers refer to.
foreach(document api.md equations.md file-formats.md examples/CMakeLists.txt)
  if(NOT EXISTS "${prefix}/share/doc/thicklens/${document}")
    message(FATAL_ERROR "${document} is not installed in share/doc/thicklens")
  endif()
endforeach()

# The examples of the documentation, and the program of docs/api.md, as a user builds and runs them.
set(examples "${work_dir}/examples")
run(${CMAKE_COMMAND} -S "${configs_dir}/../docs/examples" -B "${examples}" -G "${generator}"
    -D CMAKE_BUILD_TYPE=${config} -D CMAKE_CXX_COMPILER=${compiler} -D "CMAKE_PREFIX_PATH=${prefix}")
run(${CMAKE_COMMAND} --build "${examples}" --config ${config})
set(data_dir "${work_dir}/data")
file(MAKE_DIRECTORY "${data_dir}")
# A scene as large as the sensor of the sweep.
file(READ "${configs_dir}/scenes/demo.yaml" scene)
string(REGEX REPLACE "size_px: \\[[0-9, ]*\\]  *#" "size_px: [400, 400]  #" scene "${scene}")
string(REPLACE "../cameras/" "${configs_dir}/cameras/" scene "${scene}")
file(WRITE "${data_dir}/scene.yaml" "${scene}")
function(run_in folder)
  list(JOIN ARGN " " command)
  message(STATUS "${command}")
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY "${folder}" RESULT_VARIABLE code)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "exit ${code}: ${command}")
  endif()
endfunction()
run_in("${data_dir}" "${prefix}/${bin}/thicklens" simulate image scene.yaml -o scene --quiet)
run_in("${data_dir}" "${prefix}/${bin}/thicklens" simulate light-field scene.yaml --views 3x3
       -o truth --quiet)
run_in("${data_dir}" "${examples}/simulate_sweep" "${configs_dir}/sweeps/demo.yaml" sweep)
run_in("${data_dir}" "${examples}/calibrate_sweep" sweep/sweep.yaml camera.yaml)
run_in("${data_dir}" "${examples}/estimate" scene/picture.png scene/depth.pfm camera.yaml estimate)
run_in("${data_dir}" "${examples}/refocus" estimate 0.5 refocused.png photograph.png)
# A disparity map of 0.747 px everywhere: the float whose four bytes are the character "?".
string(REPEAT "????" 160000 disparities)
file(WRITE "${data_dir}/disparity.pfm" "Pf\n400 400\n-1.0\n${disparities}")
run_in("${data_dir}" "${examples}/custom_solver" scene/picture.png disparity.pfm custom)
run_in("${data_dir}" "${examples}/compare" truth truth)
# It reads and writes files of fixed names.
file(COPY "${data_dir}/scene/picture.png" "${data_dir}/scene/depth.pfm" DESTINATION
     "${data_dir}/sweep")
file(RENAME "${data_dir}/sweep/picture.png" "${data_dir}/sweep/photo.png")
file(RENAME "${data_dir}/sweep/depth.pfm" "${data_dir}/sweep/depth.png")
run_in("${data_dir}/sweep" "${work_dir}/consumer/first_program")
if(NOT EXISTS "${data_dir}/sweep/light_field/lightfield.yaml")
  message(FATAL_ERROR "the first program wrote no light field")
endif()
# The same files, with the camera that the first program wrote.
run_in("${data_dir}/sweep" "${work_dir}/consumer/api_program")
if(NOT EXISTS "${data_dir}/sweep/light-field/lightfield.yaml")
  message(FATAL_ERROR "the program of docs/api.md wrote no light field")
endif()
