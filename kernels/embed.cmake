# Plain files become bytes in the library. This file is included by CMake, and run by it as a script
# when the library is built:
#   cmake -Droot=DIR "-Dfiles=FILE;..." -Doutput=FILE.cc -P embed.cmake

# thicklens_embed_kernels(<variable> <files...>): names in <variable> a source that defines
# EmbeddedKernelFiles() with these files, byte for byte, each with its path in the repository. It is
# made again when one of them changes.
function(thicklens_embed_kernels variable)
  set(files)
  foreach(file IN LISTS ARGN)
    get_filename_component(path "${file}" ABSOLUTE)
    list(APPEND files "${path}")
  endforeach()
  set(output "${CMAKE_CURRENT_BINARY_DIR}/embedded_kernels.cc")
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${CMAKE_COMMAND}" "-Droot=${PROJECT_SOURCE_DIR}" "-Dfiles=${files}"
            "-Doutput=${output}" -P "${CMAKE_CURRENT_FUNCTION_LIST_FILE}"
    DEPENDS ${files} "${CMAKE_CURRENT_FUNCTION_LIST_FILE}"
    COMMENT "Embedding kernels"
    VERBATIM)
  set(${variable} "${output}" PARENT_SCOPE)
endfunction()

# The bytes are written as numbers, because string literals have escapes and a maximum length.
function(embed_files root files output)
  set(arrays "")
  set(entries "")
  set(number 0)
  foreach(file IN LISTS files)
    file(RELATIVE_PATH path "${root}" "${file}")
    file(READ "${file}" hex HEX)
    string(LENGTH "${hex}" size)
    math(EXPR size "${size} / 2")
    string(REGEX REPLACE "(................................)" "\\1\n" hex "${hex}")
    string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
    # A last 0 is added because an array cannot be empty.
    string(APPEND arrays "const unsigned char kFile${number}[] = {\n${bytes}0};\n")
    string(APPEND entries "      {\"${path}\", {reinterpret_cast<const char*>(kFile${number}), "
                          "${size}}},\n")
    math(EXPR number "${number} + 1")
  endforeach()
  file(
    WRITE "${output}"
    "// Made by kernels/embed.cmake.\n"
    "#include \"kernels/opencl/opencl_device.h\"\n\n"
    "namespace thicklens::kernels {\n"
    "namespace {\n${arrays}}  // namespace\n\n"
    "const std::vector<EmbeddedFile>& EmbeddedKernelFiles() {\n"
    "  static const std::vector<EmbeddedFile> files = {\n${entries}  };\n"
    "  return files;\n}\n\n"
    "}  // namespace thicklens::kernels\n")
endfunction()

if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  embed_files("${root}" "${files}" "${output}")
endif()
