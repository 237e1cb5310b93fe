# One place for the flags every target of ours is built with.
# -ffp-contract=off: the same inputs give the same bytes on every x86-64 and ARM build.
add_library(clamber_options INTERFACE)
target_compile_options(clamber_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion
                                                 -ffp-contract=off)
target_include_directories(clamber_options INTERFACE ${PROJECT_SOURCE_DIR})
if(CLAMBER_SANITIZE)
  string(REPLACE ";" "," _sanitizers "${CLAMBER_SANITIZE}")
  target_compile_options(clamber_options INTERFACE -fsanitize=${_sanitizers} -fno-omit-frame-pointer
                                                   -fno-sanitize-recover=all)
  target_link_options(clamber_options INTERFACE -fsanitize=${_sanitizers})
endif()
if(CLAMBER_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "CLAMBER_FUZZ needs Clang, not ${CMAKE_CXX_COMPILER_ID}")
  endif()
  target_compile_options(clamber_options INTERFACE -fsanitize=fuzzer-no-link)
endif()

# clamber_library(name SOURCES a.cpp ... LINK lib ...): a room's static library.
function(clamber_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC clamber_options ${ARG_LINK})
endfunction()

# clamber_test(name SOURCES a.cpp ... LINK lib ...): a GoogleTest program, one CTest entry.
function(clamber_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE clamber_options ${ARG_LINK} GTest::gtest_main GTest::gmock)
  target_compile_definitions(${name} PRIVATE CLAMBER_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  add_test(NAME ${name} COMMAND ${name})
endfunction()
