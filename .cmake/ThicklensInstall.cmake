# `cmake --install` and the package config, so that find_package(thicklens) works.
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/thicklens)
install(
  EXPORT thicklensTargets
  NAMESPACE thicklens::
  DESTINATION ${package_dir})
configure_package_config_file("${PROJECT_SOURCE_DIR}/.cmake/thicklensConfig.cmake.in"
                              "${PROJECT_BINARY_DIR}/thicklensConfig.cmake"
                              INSTALL_DESTINATION ${package_dir}
                              PATH_VARS THICKLENS_LIBRARY_DIR)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/thicklensConfigVersion.cmake"
                                 COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/thicklensConfig.cmake"
              "${PROJECT_BINARY_DIR}/thicklensConfigVersion.cmake"
              "${PROJECT_SOURCE_DIR}/.cmake/FindSuiteSparse.cmake" DESTINATION ${package_dir})
install(DIRECTORY "${PROJECT_SOURCE_DIR}/configs/" DESTINATION ${CMAKE_INSTALL_DATADIR}/thicklens)
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION ${CMAKE_INSTALL_DOCDIR})
