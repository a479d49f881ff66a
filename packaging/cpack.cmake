# Read by cpack before it packs anything.
if(NOT CPACK_HEAVE_PREFIX STREQUAL "/usr")
  message(FATAL_ERROR "the units name programs in ${CPACK_HEAVE_PREFIX}: a package takes -DCMAKE_INSTALL_PREFIX=/usr, as tools/package does it")
endif()
# All times in the package are that of its changelog, so that the same source gives the same bytes.
if(NOT DEFINED ENV{SOURCE_DATE_EPOCH})
  file(STRINGS ${CPACK_HEAVE_CHANGELOG} entries REGEX "^ -- ")
  list(GET entries 0 newest)
  string(REGEX REPLACE "^.*>  " "" date ${newest})
  execute_process(COMMAND date -u -d ${date} +%s OUTPUT_VARIABLE seconds OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  set(ENV{SOURCE_DATE_EPOCH} ${seconds})
endif()
