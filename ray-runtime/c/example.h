/* What the example needs of its machine. */
#ifndef EXAMPLE_H
#define EXAMPLE_H

#include <stddef.h>

void print(const char *text);

/* The memory that begins with a blob, at a multiple of 8. */
const void *flash(size_t *length);

/* The example; 0 if all went well. */
int example(void);

#endif
