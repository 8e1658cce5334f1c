/* Fields of messages by the names of docs/rig-protocol.md: for reading and writing what the vector files say.
 * Written from the page and not from the core, so that one checks the other. */
#ifndef FIELDS_H
#define FIELDS_H

#include <stdbool.h>
#include <stdint.h>

struct message {
    uint8_t bytes[64];
    uint8_t length;
};

/* The CRC of docs/rig-protocol.md, bit by bit as its definition has it. */
uint16_t defined_crc(const uint8_t *bytes, unsigned length);

/* Bytes of a hexadecimal word, "-" for none; returns how many. */
unsigned unhex(const char *word, uint8_t *bytes, unsigned size);

/* A message from the host with every field 0, its length and CRC right; false: no such name. */
bool host_message(const char *name, unsigned axes, struct message *message);

/* Whether a message is of the named type and of the right length. */
bool is_message(const char *name, unsigned axes, const struct message *message);

/* Write "<field>=<value>" into a message, and its CRC. */
void set_field(struct message *message, unsigned axes, const char *assignment);

/* The field's value as the files write it, into `value`. Ends the program when there is no such field. */
void get_field(const struct message *message, unsigned axes, const char *field, char *value, unsigned size);

/* The same, whether "<field>=<value>" holds. */
bool has_field(const struct message *message, unsigned axes, const char *assignment);

#endif
