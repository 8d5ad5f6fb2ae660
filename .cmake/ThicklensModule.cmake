# A module is a folder, a target and a namespace (see CONTRIBUTING.md).

# Compiler settings that every target of the project shares.
function(thicklens_compile_settings target)
  # GCC collects garbage only above 512 MiB, which takes a tenth less time and a tenth more memory.
  # clang-tidy does not know the option.
  set(saves_time OFF)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_CXX_CLANG_TIDY)
    set(saves_time ON)
  endif()
  target_compile_options(
    ${target} PRIVATE -Wall -Wextra -Wconversion -Wshadow
                      $<$<BOOL:${THICKLENS_WARNINGS_AS_ERRORS}>:-Werror>
                      $<$<BOOL:${saves_time}>:--param=ggc-min-heapsize=524288>)
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

# Whether the modules are built as shared libraries besides the static ones: to be installed, or for the
# test of their exported symbols. A sanitizer's functions are defined only in the program.
set(THICKLENS_BUILDS_SHARED ${THICKLENS_SHARED_LIBS})
if(THICKLENS_BUILD_TESTS AND NOT THICKLENS_SANITIZE)
  set(THICKLENS_BUILDS_SHARED ON)
endif()

# thicklens_module(<name> SOURCES <files...> HEADERS <files below [ROOM/]include/...> INTERNAL_HEADERS <files...> PRECOMPILE <headers of libraries...>)
#
# A module is compiled once and gives the static library thicklens_<name>, which the program and the
# tests link because they use its hidden parts as well, and the shared library thicklens_<name>_shared.
# The one that THICKLENS_SHARED_LIBS asks for is installed and is thicklens::<name> for others.
#
# INTERNAL_HEADERS are below include/ like the others, and any module may use them, but they are not
# installed: no header of HEADERS may include one.
function(thicklens_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;HEADERS;INTERNAL_HEADERS;PRECOMPILE" ${ARGN})
  set(target thicklens_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  # Also in a project that contains this one: only what THICKLENS_EXPORT marks is exported.
  set_target_properties(
    ${target} PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden
                         VISIBILITY_INLINES_HIDDEN ON)
  thicklens_module_headers(${target} HEADERS ${ARG_HEADERS} INTERNAL_HEADERS ${ARG_INTERNAL_HEADERS})
  # Private headers are included by their path in the repository.
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}")
  thicklens_compile_settings(${target})
  # The headers that most files include and that take longest to compile. Each file still includes
  # what it uses, because files are compiled without precompiled headers if there is ccache.
  target_precompile_headers(${target} PRIVATE ${ARG_PRECOMPILE} <algorithm> <cmath> <functional>
                            <optional> <string> <vector>)
  set(installed ${target})
  if(THICKLENS_BUILDS_SHARED)
    thicklens_shared_library(${name})
    thicklens_module_headers(${target}_shared HEADERS ${ARG_HEADERS})
    set_target_properties(${target}_shared PROPERTIES EXPORT_NAME ${name})
    if(THICKLENS_SHARED_LIBS)
      set(installed ${target}_shared)
    else()
      # The test of the installation installs this component from the build of the static libraries.
      install(
        TARGETS ${target}_shared
        EXPORT thicklensSharedTargets
        LIBRARY COMPONENT thicklens_shared EXCLUDE_FROM_ALL NAMELINK_COMPONENT thicklens_shared
        FILE_SET HEADERS COMPONENT thicklens_shared EXCLUDE_FROM_ALL)
    endif()
  endif()
  add_library(thicklens::${name} ALIAS ${installed})
  set_target_properties(${installed} PROPERTIES EXPORT_NAME ${name})
  install(
    TARGETS ${installed}
    EXPORT thicklensTargets
    FILE_SET HEADERS)

  foreach(header IN LISTS ARG_INTERNAL_HEADERS)
    cmake_path(ABSOLUTE_PATH header NORMALIZE)
    cmake_path(RELATIVE_PATH header BASE_DIRECTORY "${PROJECT_SOURCE_DIR}")
    set_property(GLOBAL APPEND PROPERTY THICKLENS_INTERNAL_HEADERS "${header}")
  endforeach()
  if(ARG_INTERNAL_HEADERS AND CMAKE_VERIFY_INTERFACE_HEADER_SETS)
    # Internal headers must compile alone as well, but a set of headers of an installed target would
    # be installed.
    thicklens_include_dirs(dirs ${ARG_INTERNAL_HEADERS})
    add_library(${target}_internal INTERFACE)
    target_sources(${target}_internal INTERFACE FILE_SET HEADERS BASE_DIRS ${dirs} FILES
                                                ${ARG_INTERNAL_HEADERS})
    target_link_libraries(${target}_internal INTERFACE ${target})
  endif()
endfunction()

# thicklens_include_dirs(<variable> <headers...>): the folders include/ of the headers. Each room has its
# headers in one of its own.
function(thicklens_include_dirs variable)
  set(dirs ${ARGN})
  list(TRANSFORM dirs REPLACE "include/thicklens/.*$" "include")
  list(REMOVE_DUPLICATES dirs)
  set(${variable} ${dirs} PARENT_SCOPE)
endfunction()

# thicklens_module_headers(<target> HEADERS <files...> INTERNAL_HEADERS <files...>)
function(thicklens_module_headers target)
  cmake_parse_arguments(ARG "" "" "HEADERS;INTERNAL_HEADERS" ${ARGN})
  thicklens_include_dirs(dirs ${ARG_HEADERS})
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${dirs} FILES ${ARG_HEADERS})
  thicklens_include_dirs(dirs ${ARG_HEADERS} ${ARG_INTERNAL_HEADERS})
  foreach(dir IN LISTS dirs)
    target_include_directories(
      ${target} PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/${dir}>)
  endforeach()
  target_include_directories(${target} PUBLIC $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_17)
endfunction()

# thicklens_shared_library(<name>): the shared library of the module's objects.
function(thicklens_shared_library name)
  set(target thicklens_${name}_shared)
  add_library(${target} SHARED $<TARGET_OBJECTS:thicklens_${name}>)
  # Before 1.0, each minor version may change the interface.
  set(abi ${PROJECT_VERSION_MAJOR})
  if(abi EQUAL 0)
    string(APPEND abi .${PROJECT_VERSION_MINOR})
  endif()
  # In the build as where they are installed, the libraries find each other beside themselves. One of
  # them finds the library that it loads there (tools/CMakeLists.txt), or in a folder below.
  set_target_properties(
    ${target}
    PROPERTIES OUTPUT_NAME thicklens_${name}
               VERSION ${PROJECT_VERSION}
               SOVERSION ${abi}
               LINKER_LANGUAGE CXX
               LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/tools"
               INSTALL_RPATH "$ORIGIN;$ORIGIN/thicklens"
               BUILD_WITH_INSTALL_RPATH ON
               INSTALL_RPATH_USE_LINK_PATH ON
               VERIFY_INTERFACE_HEADER_SETS OFF)
  if(NOT THICKLENS_SHARED_LIBS)
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  if(NOT APPLE AND NOT WIN32)
    # The compiler exports templates of the standard library that the module instantiates, whatever
    # its visibility.
    set(script "${PROJECT_SOURCE_DIR}/.cmake/exported_symbols.map")
    target_link_options(${target} PRIVATE "LINKER:--version-script,${script}")
    set_property(TARGET ${target} PROPERTY LINK_DEPENDS "${script}")
    if(NOT THICKLENS_SANITIZE)
      target_link_options(${target} PRIVATE "LINKER:-z,defs")
    endif()
  endif()
endfunction()

# thicklens_module_link(<name> PUBLIC|PRIVATE <libraries...>): target_link_libraries for both libraries of
# the module. Another module is given as thicklens::<name>.
function(thicklens_module_link name)
  list(TRANSFORM ARGN REPLACE "^thicklens::(.+)$" "thicklens_\\1" OUTPUT_VARIABLE libraries)
  target_link_libraries(thicklens_${name} ${libraries})
  if(TARGET thicklens_${name}_shared)
    list(TRANSFORM ARGN REPLACE "^thicklens::(.+)$" "thicklens_\\1_shared" OUTPUT_VARIABLE libraries)
    target_link_libraries(thicklens_${name}_shared ${libraries})
  endif()
endfunction()
