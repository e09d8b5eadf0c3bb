# cmake -DINPUT=FILE -DOUTPUT=HEADER -DNAME=NAME -P embed.cmake – a file's bytes as `static const unsigned char NAME[]`.
file(READ ${INPUT} bytes HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUTPUT} "static const unsigned char ${NAME}[] = {${bytes}};\n")
