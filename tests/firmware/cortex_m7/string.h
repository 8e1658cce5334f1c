/* The only library functions that the firmware uses, for a compiler that has no library for this processor. */
#ifndef STRING_H
#define STRING_H

#include <stddef.h>

void *memcpy(void *to, const void *from, size_t size);
void *memset(void *at, int value, size_t size);

#endif
