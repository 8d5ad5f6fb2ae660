# UMFPACK and CHOLMOD of SuiteSparse, which has no CMake package of its own in version 5.
# Targets: SuiteSparse::umfpack, SuiteSparse::cholmod, SuiteSparse::suitesparseconfig.
find_path(SuiteSparse_INCLUDE_DIR umfpack.h PATH_SUFFIXES suitesparse)
find_library(SuiteSparse_UMFPACK_LIBRARY umfpack)
find_library(SuiteSparse_CHOLMOD_LIBRARY cholmod)
find_library(SuiteSparse_SUITESPARSECONFIG_LIBRARY suitesparseconfig)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(
  SuiteSparse REQUIRED_VARS SuiteSparse_UMFPACK_LIBRARY SuiteSparse_CHOLMOD_LIBRARY
                            SuiteSparse_SUITESPARSECONFIG_LIBRARY SuiteSparse_INCLUDE_DIR)
mark_as_advanced(SuiteSparse_INCLUDE_DIR SuiteSparse_UMFPACK_LIBRARY SuiteSparse_CHOLMOD_LIBRARY
                 SuiteSparse_SUITESPARSECONFIG_LIBRARY)

if(SuiteSparse_FOUND)
  foreach(name IN ITEMS umfpack cholmod suitesparseconfig)
    string(TOUPPER ${name} upper)
    if(NOT TARGET SuiteSparse::${name})
      add_library(SuiteSparse::${name} UNKNOWN IMPORTED)
      set_target_properties(
        SuiteSparse::${name}
        PROPERTIES IMPORTED_LOCATION "${SuiteSparse_${upper}_LIBRARY}"
                   INTERFACE_INCLUDE_DIRECTORIES "${SuiteSparse_INCLUDE_DIR}")
    endif()
  endforeach()
endif()
