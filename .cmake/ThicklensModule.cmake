# A folder is a module is a target is a namespace (see CONTRIBUTING.md).

# Compiler settings that every target of the project shares.
function(thicklens_compile_settings target)
  target_compile_options(
    ${target} PRIVATE -Wall -Wextra -Wconversion -Wshadow
                      $<$<BOOL:${THICKLENS_WARNINGS_AS_ERRORS}>:-Werror>)
  if(THICKLENS_SANITIZE)
    # Without the checks of each pointer that take a quarter of the time of compiling: null pointers
    # and sizes are told by the address sanitizer, and alignment by instructions that ask for it.
    target_compile_options(
      ${target}
      PUBLIC -fsanitize=${THICKLENS_SANITIZE} -fno-sanitize=null,alignment,object-size
             -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${THICKLENS_SANITIZE})
    # Under a sanitizer Eigen would align memory by itself, but the Eigen inside of Debian's Ceres
    # does not: the linker takes one's malloc and the other's free.
    target_compile_definitions(${target} PUBLIC EIGEN_MALLOC_ALREADY_ALIGNED=1)
  endif()
endfunction()

# For targets most of whose time goes into what libraries make of templates anew in each file: command
# lines and JSON. Their files must not give one name to two things, in namespaces without name either.
function(thicklens_unity_build target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${THICKLENS_UNITY_BUILD}
                                             UNITY_BUILD_BATCH_SIZE 10)
  if(THICKLENS_UNITY_BUILD)
    # A local name that another file of the ten uses outside shadows nothing.
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
  # What takes longest to read of what most files include. Each still includes what it uses: files are
  # compiled without this where there is ccache.
  target_precompile_headers(${target} PRIVATE ${ARG_PRECOMPILE} <algorithm> <cmath> <functional>
                            <optional> <string> <vector>)
  install(
    TARGETS ${target}
    EXPORT thicklensTargets
    FILE_SET HEADERS)
endfunction()
