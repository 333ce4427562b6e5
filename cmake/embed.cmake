# Files as arrays of a C program.
#
# usage: cmake -D "FILES=NAME=PATH;..." -D OUT=FILE.c -P embed.cmake
#
# For each: const unsigned char NAME[], with a zero behind it, and const size_t NAME_bytes. A PATH
# that is empty makes an empty array. String literals, as compilers read them in a tenth of the time
# of numbers.
set(text "#include \"page_files.h\"\n")
foreach(file IN LISTS FILES)
  string(REGEX MATCH "^([a-z_]+)=(.*)$" file "${file}")
  set(name ${CMAKE_MATCH_1})
  set(path ${CMAKE_MATCH_2})
  set(bytes 0)
  set(hex "")
  if(path)
    file(SIZE ${path} bytes)
    file(READ ${path} hex HEX)
  endif()
  string(REGEX REPLACE "(................................................................)" "\\1\n" hex "${hex}")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" hex "${hex}")
  string(REPLACE "\n" "\"\n\"" hex "${hex}")
  string(APPEND text "\nconst size_t ${name}_bytes = ${bytes};\n"
    "const unsigned char ${name}[] =\n\"${hex}\";\n")
endforeach()
file(WRITE ${OUT} "${text}")
