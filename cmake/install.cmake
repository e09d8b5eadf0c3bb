# Program, library, headers, pkg-config file, man page, shell completion.
include(${PROJECT_SOURCE_DIR}/cmake/headers.cmake)
install(TARGETS tsuya_program tsuya_static tsuya_shared
  RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})

# A header is public when it declares something with TSUYA_API (or is what those stand on); the others stay inside.
foreach(header ${TSUYA_PUBLIC_HEADERS})
  get_filename_component(room ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/tsuya/${room})
endforeach()

foreach(kind LIBDIR INCLUDEDIR)
  if(IS_ABSOLUTE "${CMAKE_INSTALL_${kind}}")
    set(TSUYA_PC_${kind} "${CMAKE_INSTALL_${kind}}")
  else()
    set(TSUYA_PC_${kind} "\${prefix}/${CMAKE_INSTALL_${kind}}")
  endif()
endforeach()
# What the static library needs; not Requires.private, which would ask users of the shared one for all these packages.
string(JOIN " " TSUYA_PC_PRIVATE -lopencv_mcc -lopencv_imgcodecs -lopencv_imgproc -lopencv_core -lOpenEXRCore ${CJSON_LDFLAGS} ${YAML_LDFLAGS}
  ${EXIF_LDFLAGS} ${RAW_LDFLAGS} ${XXHASH_LDFLAGS} ${SQLITE_LDFLAGS} ${APRILTAG_LDFLAGS} ${CAIRO_LDFLAGS} ${PCL_SURFACE_LDFLAGS}
  -lembree3 -lmeshoptimizer -lmrcal -lcholmod -llapacke -lgomp -lstdc++ -lm -lpthread)
configure_file(${PROJECT_SOURCE_DIR}/cmake/tsuya.pc.in ${PROJECT_BINARY_DIR}/tsuya.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/tsuya.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

install(FILES docs/tsuya.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES completion/tsuya.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME tsuya)
install(FILES completion/_tsuya DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} FILES_MATCHING PATTERN "*.md" PATTERN "*.yaml")
