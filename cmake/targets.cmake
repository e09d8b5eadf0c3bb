# tsuya_module(ROOM SOURCES … [NEEDS libraries …]) – one room of the house as an object library.
# tsuya_library()                                  – libtsuya, static and shared, out of all rooms.
# tsuya_test(ROOM NAME [SOURCES …] [LABELS …] [TIMEOUT s]) – tests/ROOM/NAME.c as one ctest.
set_property(GLOBAL PROPERTY TSUYA_MODULES "")
set_property(GLOBAL PROPERTY TSUYA_NEEDS "")

add_library(tsuya_options INTERFACE)
target_compile_options(tsuya_options INTERFACE
  -Wall -Wextra -Wshadow -Wpointer-arith -Wundef -Wvla -Wno-format-truncation
  $<$<COMPILE_LANGUAGE:C>:-Wstrict-prototypes -Wmissing-prototypes -Wconversion -Wno-sign-conversion>
  -fno-math-errno -ffp-contract=off
  $<$<BOOL:${TSUYA_WERROR}>:-Werror>
  $<$<BOOL:${TSUYA_COVERAGE}>:--coverage>)
target_compile_definitions(tsuya_options INTERFACE _GNU_SOURCE TSUYA_VERSION="${PROJECT_VERSION}")
target_include_directories(tsuya_options INTERFACE ${PROJECT_SOURCE_DIR})
target_link_options(tsuya_options INTERFACE $<$<BOOL:${TSUYA_COVERAGE}>:--coverage>)
if(TSUYA_SANITIZE)
  target_compile_options(tsuya_options INTERFACE -fsanitize=${TSUYA_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(tsuya_options INTERFACE -fsanitize=${TSUYA_SANITIZE})
endif()

function(tsuya_module room)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;NEEDS")
  add_library(tsuya_${room} OBJECT ${arg_SOURCES})
  target_link_libraries(tsuya_${room} PRIVATE tsuya_options OpenMP::OpenMP_C OpenMP::OpenMP_CXX ${arg_NEEDS})
  set_target_properties(tsuya_${room} PROPERTIES C_VISIBILITY_PRESET hidden CXX_VISIBILITY_PRESET hidden)
  set_property(GLOBAL APPEND PROPERTY TSUYA_MODULES ${room})
  set_property(GLOBAL APPEND PROPERTY TSUYA_NEEDS ${arg_NEEDS})
endfunction()

function(tsuya_library)
  get_property(rooms GLOBAL PROPERTY TSUYA_MODULES)
  get_property(needs GLOBAL PROPERTY TSUYA_NEEDS)
  list(REMOVE_DUPLICATES needs)
  set(objects)
  foreach(room ${rooms})
    list(APPEND objects $<TARGET_OBJECTS:tsuya_${room}>)
  endforeach()
  foreach(kind STATIC SHARED)
    string(TOLOWER ${kind} suffix)
    add_library(tsuya_${suffix} ${kind} ${objects})
    set_target_properties(tsuya_${suffix} PROPERTIES OUTPUT_NAME tsuya VERSION ${PROJECT_VERSION} SOVERSION 0)
    target_link_libraries(tsuya_${suffix} PRIVATE tsuya_options ${needs} OpenMP::OpenMP_C Threads::Threads m)
  endforeach()
  target_link_options(tsuya_shared PRIVATE -Wl,--no-undefined
    -Wl,--version-script=${PROJECT_SOURCE_DIR}/cmake/libtsuya.map)
  set_target_properties(tsuya_shared PROPERTIES LINK_DEPENDS ${PROJECT_SOURCE_DIR}/cmake/libtsuya.map)
endfunction()

# A test links the static library, so that it reaches what is not exported.  Exit 77 counts as skipped.
function(tsuya_test room name)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "TIMEOUT" "SOURCES;LABELS;NEEDS")
  add_executable(${name} ${name}.c ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE tsuya_static tsuya_options OpenMP::OpenMP_C PkgConfig::CMOCKA ${arg_NEEDS} m)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE TSUYA_SOURCE_DIR="${PROJECT_SOURCE_DIR}" TSUYA_DATA_DEFAULT="${TSUYA_DATA}")
  add_test(NAME ${room}/${name} COMMAND ${name} WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR})
  if(name MATCHES "^bench_") # `tsuya bench` runs them
    install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/tsuya)
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  set_tests_properties(${room}/${name} PROPERTIES LABELS "${room};${arg_LABELS}" SKIP_RETURN_CODE 77 TIMEOUT ${arg_TIMEOUT})
  if(TSUYA_SANITIZE MATCHES "address")
    set_tests_properties(${room}/${name} PROPERTIES ENVIRONMENT "LSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/cmake/lsan.supp")
  elseif(TSUYA_SANITIZE STREQUAL "thread")
    set_tests_properties(${room}/${name} PROPERTIES
      ENVIRONMENT "OMP_THREAD_LIMIT=1;TSAN_OPTIONS=suppressions=${PROJECT_SOURCE_DIR}/cmake/tsan.supp:ignore_noninstrumented_modules=1")
  endif()
endfunction()
