# A module is a folder, a target and a namespace (see CONTRIBUTING.md).

# Compiler settings that every target of the project shares.
function(thicklens_compile_settings target)
  target_compile_options(
    ${target} PRIVATE -Wall -Wextra -Wconversion -Wshadow
                      $<$<BOOL:${THICKLENS_WARNINGS_AS_ERRORS}>:-Werror>)
  if(THICKLENS_SANITIZE)
    # The checks of each pointer, which take a quarter of the compile time, are off: the address
    # sanitizer detects null pointers and wrong sizes, and aligned instructions wrong alignment.
    target_compile_options(
      ${target}
      PUBLIC -fsanitize=${THICKLENS_SANITIZE} -fno-sanitize=null,alignment,object-size
             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${THICKLENS_SANITIZE})
    # Under a sanitizer Eigen would align memory by itself, but the Eigen in Debian's Ceres does not,
    # and the linker would combine the malloc of one with the free of the other.
    target_compile_definitions(${target} PUBLIC EIGEN_MALLOC_ALREADY_ALIGNED=1)
  endif()
endfunction()

# Unity builds, for targets whose compile time is mostly that of library templates in each file:
# command lines and JSON. Two of their files must not define the same name, not even in unnamed
# namespaces.
function(thicklens_unity_build target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${THICKLENS_UNITY_BUILD}
                                             UNITY_BUILD_BATCH_SIZE 10)
  if(THICKLENS_UNITY_BUILD)
    # A local name that another file of the ten defines at namespace scope is not a real shadowing.
    target_compile_options(${target} PRIVATE -Wno-shadow)
  endif()
endfunction()

# thicklens_module(<name> SOURCES <files...> HEADERS <files below [ROOM/]include/...> PRECOMPILE <headers of libraries...>)
function(thicklens_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;PRECOMPILE" ${ARGN})
  set(target thicklens_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(thicklens::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  # Each room has its public headers in a folder include/ of its own.
  set(include_dirs ${ARG_HEADERS})
  list(TRANSFORM include_dirs REPLACE "include/thicklens/.*$" "include")
  list(REMOVE_DUPLICATES include_dirs)
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${include_dirs} FILES ${ARG_HEADERS})
  foreach(dir IN LISTS include_dirs)
    target_include_directories(
      ${target} PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/${dir}>)
  endforeach()
  # Private headers are included by their path in the repository.
  target_include_directories(
    ${target}
    PUBLIC $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
    PRIVATE "${PROJECT_SOURCE_DIR}")
  target_compile_features(${target} PUBLIC cxx_std_17)
  thicklens_compile_settings(${target})
  # The headers that most files include and that take longest to compile. Each file still includes
  # what it uses, because files are compiled without precompiled headers if there is ccache.
  target_precompile_headers(${target} PRIVATE ${ARG_PRECOMPILE} <algorithm> <cmath> <functional>
                            <optional> <string> <vector>)
  install(
    TARGETS ${target}
    EXPORT thicklensTargets
    FILE_SET HEADERS)
endfunction()
