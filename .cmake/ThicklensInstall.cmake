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
# The comments of the headers refer to these documents.
install(
  FILES "${PROJECT_SOURCE_DIR}/LICENSE" "${PROJECT_SOURCE_DIR}/docs/api.md"
        "${PROJECT_SOURCE_DIR}/docs/equations.md" "${PROJECT_SOURCE_DIR}/docs/file-formats.md"
  DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY "${PROJECT_SOURCE_DIR}/docs/examples" DESTINATION ${CMAKE_INSTALL_DOCDIR})

# The same package with the shared libraries, for the test of the installation (ThicklensModule.cmake).
if(THICKLENS_BUILDS_SHARED AND NOT THICKLENS_SHARED_LIBS)
  function(thicklens_install_shared_component)
    set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/thicklens-shared)
    set(component COMPONENT thicklens_shared EXCLUDE_FROM_ALL)
    set(THICKLENS_SHARED_LIBS ON)
    install(
      EXPORT thicklensSharedTargets
      NAMESPACE thicklens::
      FILE thicklensTargets.cmake
      DESTINATION ${package_dir} ${component})
    configure_package_config_file("${PROJECT_SOURCE_DIR}/.cmake/thicklensConfig.cmake.in"
                                  "${PROJECT_BINARY_DIR}/shared/thicklensConfig.cmake"
                                  INSTALL_DESTINATION ${package_dir}
                                  PATH_VARS THICKLENS_LIBRARY_DIR)
    install(FILES "${PROJECT_BINARY_DIR}/shared/thicklensConfig.cmake"
                  "${PROJECT_BINARY_DIR}/thicklensConfigVersion.cmake" DESTINATION ${package_dir}
            ${component})
    if(TARGET thicklens_image_library)
      install(TARGETS thicklens_image_library LIBRARY DESTINATION ${THICKLENS_LIBRARY_DIR}
                                                      ${component})
    endif()
    install(TARGETS thicklens_array_library LIBRARY DESTINATION ${THICKLENS_LIBRARY_DIR}
                                                    ${component})
  endfunction()
  thicklens_install_shared_component()
endif()
