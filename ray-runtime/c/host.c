/* The example on a workstation: host BLOB reads the file into memory and calls that its flash. */
#include "example.h"
#include <stdint.h>
#include <stdio.h>

/* Words of 8 bytes, because a blob must lie at a multiple of 8. */
static uint64_t memory[1 << 17];
static size_t memory_length;

void print(const char *text)
{
    fputs(text, stdout);
}

const void *flash(size_t *length)
{
    *length = memory_length;
    return memory;
}

int main(int count, char **arguments)
{
    FILE *file = count == 2 ? fopen(arguments[1], "rb") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: host BLOB\n");
        return 2;
    }
    memory_length = fread(memory, 1, sizeof memory, file);
    fclose(file);
    return example();
}
