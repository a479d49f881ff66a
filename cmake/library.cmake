# library.cmake - the core as an installed library: cmake --install BUILD --component library --prefix PREFIX
# A component of its own: a machine that runs heaved needs neither headers nor archive, and the package leaves them out.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(library COMPONENT library EXCLUDE_FROM_ALL)
set(library_cmake_dir ${CMAKE_INSTALL_LIBDIR}/cmake/heave)

target_include_directories(heave_core INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
set_target_properties(heave_core PROPERTIES EXPORT_NAME core)
install(TARGETS heave_core EXPORT heave ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} ${library})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/heave DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} ${library} FILES_MATCHING PATTERN "*.h")
install(EXPORT heave FILE heaveConfig.cmake NAMESPACE heave:: DESTINATION ${library_cmake_dir} ${library})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/heaveConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/heaveConfigVersion.cmake DESTINATION ${library_cmake_dir} ${library})
file(RELATIVE_PATH library_up /${CMAKE_INSTALL_LIBDIR}/pkgconfig /) # to the prefix, so that the folder may be moved
configure_file(${PROJECT_SOURCE_DIR}/cmake/heave.pc.in ${PROJECT_BINARY_DIR}/heave.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/heave.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig ${library})
