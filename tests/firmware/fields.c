#include "fields.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum kind { NUMBER, SIGNED, VERSION, TEXT };

struct field {
    const char *type, *name; /* type "host" or "device": in all of that side */
    unsigned offset, size;
    enum kind kind;
};

/* A name that ends in '*' stands for one field an axis. */
static const struct field FIELDS[] = {
    {"host", "sequence", 2, 2, NUMBER},
    {"DESCRIBE", "axis", 4, 1, NUMBER},
    {"SET_HOME", "axis", 4, 1, NUMBER},
    {"SET_HOME", "home", 5, 4, SIGNED},
    {"POLL", "answer_after", 4, 2, NUMBER},
    {"FORCE", "answer_after", 4, 2, NUMBER},
    {"FORCE", "force*", 6, 4, SIGNED},
    {"PING", "token", 4, 4, NUMBER},
    {"device", "sequence", 2, 2, NUMBER},
    {"device", "echo", 4, 2, NUMBER},
    {"device", "time", 6, 4, NUMBER},
    {"IDENTITY", "axes", 10, 1, NUMBER},
    {"IDENTITY", "capabilities", 11, 1, NUMBER},
    {"IDENTITY", "buttons", 12, 1, NUMBER},
    {"IDENTITY", "flags", 13, 1, NUMBER},
    {"IDENTITY", "host_silence", 14, 2, NUMBER},
    {"IDENTITY", "nominal_rate", 16, 2, NUMBER},
    {"IDENTITY", "firmware", 18, 3, VERSION},
    {"IDENTITY", "model", 21, 16, TEXT},
    {"IDENTITY", "serial", 37, 12, TEXT},
    {"AXIS", "axis", 10, 1, NUMBER},
    {"AXIS", "count", 11, 4, NUMBER},
    {"AXIS", "max_force", 15, 4, NUMBER},
    {"AXIS", "lowest", 19, 4, SIGNED},
    {"AXIS", "highest", 23, 4, SIGNED},
    {"AXIS", "home", 27, 4, SIGNED},
    {"STATE", "flags", 10, 1, NUMBER},
    {"STATE", "fault", 11, 1, NUMBER},
    {"STATE", "buttons", 12, 2, NUMBER},
    {"STATE", "position*", 14, 4, SIGNED},
    {"STATE", "force*", 14, 4, SIGNED}, /* behind the positions */
    {"PONG", "token", 10, 4, NUMBER},
    {"PONG", "received", 14, 4, NUMBER},
    {"PONG", "lost", 18, 2, NUMBER},
    {"PONG", "damaged", 20, 2, NUMBER},
    {"PONG", "stale", 22, 2, NUMBER},
    {"FAULT", "fault", 10, 1, NUMBER},
    {"FAULT", "axis", 11, 1, NUMBER},
    {"FAULT", "detail", 12, 4, SIGNED},
    {"REFUSED", "reason", 10, 1, NUMBER},
    {"REFUSED", "type", 11, 1, NUMBER},
};

static const struct {
    const char *name;
    uint8_t code;
    unsigned length, length_an_axis;
} TYPES[] = {
    {"HELLO", 0x01, 6, 0},  {"DESCRIBE", 0x02, 7, 0},  {"SET_HOME", 0x03, 11, 0}, {"ENABLE", 0x04, 6, 0},
    {"DISABLE", 0x05, 6, 0}, {"POLL", 0x06, 8, 0},     {"FORCE", 0x07, 8, 4},     {"PING", 0x08, 10, 0},
    {"IDENTITY", 0x81, 51, 0}, {"AXIS", 0x82, 33, 0},  {"STATE", 0x84, 16, 8},    {"PONG", 0x88, 26, 0},
    {"FAULT", 0x90, 18, 0}, {"REFUSED", 0x91, 14, 0},
};

#define COUNT(table) (sizeof(table) / sizeof *(table))

static _Noreturn void give_up(const char *what, const char *about)
{
    fprintf(stderr, "%s: %s\n", what, about);
    exit(1);
}

uint16_t defined_crc(const uint8_t *bytes, unsigned length)
{
    uint16_t crc = 0xffff;
    for (unsigned i = 0; i < length; i++) {
        crc = (uint16_t)(crc ^ bytes[i] << 8);
        for (int bit = 0; bit < 8; bit++) {
            crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
        }
    }
    return crc;
}

static void seal(struct message *message)
{
    uint16_t crc = defined_crc(message->bytes, message->length - 2u);
    message->bytes[message->length - 2] = (uint8_t)crc;
    message->bytes[message->length - 1] = (uint8_t)(crc >> 8);
}

unsigned unhex(const char *word, uint8_t *bytes, unsigned size)
{
    unsigned length = 0;
    for (; *word != '-' && *word != '\0'; word += 2) {
        unsigned byte;
        if (length == size || sscanf(word, "%2x", &byte) != 1) {
            give_up("not bytes", word);
        }
        bytes[length++] = (uint8_t)byte;
    }
    return length;
}

static unsigned type_index(const char *name)
{
    for (unsigned i = 0; i < COUNT(TYPES); i++) {
        if (strcmp(TYPES[i].name, name) == 0) {
            return i;
        }
    }
    give_up("no such message", name);
    return 0;
}

bool host_message(const char *name, unsigned axes, struct message *message)
{
    unsigned type = type_index(name);
    *message = (struct message){.length = (uint8_t)(TYPES[type].length + axes * TYPES[type].length_an_axis)};
    message->bytes[0] = 1;
    message->bytes[1] = TYPES[type].code;
    seal(message);
    return TYPES[type].code < 0x80;
}

bool is_message(const char *name, unsigned axes, const struct message *message)
{
    unsigned type = type_index(name);
    struct message sealed = *message;
    if (message->length != TYPES[type].length + axes * TYPES[type].length_an_axis) {
        return false;
    }
    seal(&sealed);
    return message->bytes[0] == 1 && message->bytes[1] == TYPES[type].code &&
           memcmp(&sealed, message, sizeof sealed) == 0;
}

/* "force2" is "force*" of axis 2; -1: another name. */
static int axis_of(const char *pattern, const char *name)
{
    size_t stem = strcspn(pattern, "*");
    if (strncmp(pattern, name, stem) != 0) {
        return -1;
    }
    if (pattern[stem] == '\0') {
        return name[stem] == '\0' ? 0 : -1;
    }
    return name[stem] >= '0' && name[stem] <= '2' && name[stem + 1] == '\0' ? name[stem] - '0' : -1;
}

static bool belongs(const struct field *field, uint8_t type)
{
    if (strcmp(field->type, "host") == 0 || strcmp(field->type, "device") == 0) {
        return (type >= 0x80) == (strcmp(field->type, "device") == 0);
    }
    return TYPES[type_index(field->type)].code == type;
}

static struct field find(const struct message *message, unsigned axes, const char *name)
{
    for (unsigned i = 0; i < COUNT(FIELDS); i++) {
        struct field field = FIELDS[i];
        int axis = axis_of(field.name, name);
        if (axis < 0 || (unsigned)axis >= axes || !belongs(&field, message->bytes[1])) {
            continue;
        }
        field.offset += 4u * (unsigned)axis;
        if (strcmp(field.type, "STATE") == 0 && strcmp(field.name, "force*") == 0) {
            field.offset += 4 * axes;
        }
        return field;
    }
    give_up("no such field", name);
    return FIELDS[0];
}

void set_field(struct message *message, unsigned axes, const char *assignment)
{
    char name[32] = "";
    int64_t value = 0;
    if (sscanf(assignment, "%31[^=]=%" SCNd64, name, &value) != 2) {
        give_up("not a field and its value", assignment);
    }
    struct field field = find(message, axes, name);
    for (unsigned i = 0; i < field.size; i++) {
        message->bytes[field.offset + i] = (uint8_t)(value >> 8 * i);
    }
    seal(message);
}

void get_field(const struct message *message, unsigned axes, const char *name, char *value, unsigned size)
{
    struct field field = find(message, axes, name);
    const uint8_t *at = message->bytes + field.offset;
    uint32_t number = 0;
    for (unsigned i = 0; i < field.size && i < 4; i++) {
        number |= (uint32_t)at[i] << 8 * i;
    }
    switch (field.kind) {
    case NUMBER:
        snprintf(value, size, "%" PRIu32, number);
        break;
    case SIGNED:
        snprintf(value, size, "%" PRId32, (int32_t)number);
        break;
    case VERSION:
        snprintf(value, size, "%u.%u.%u", at[0], at[1], at[2]);
        break;
    case TEXT:
        snprintf(value, size, "%.*s", (int)field.size, (const char *)at);
        break;
    }
}

bool has_field(const struct message *message, unsigned axes, const char *assignment)
{
    char name[32] = "";
    char value[32];
    sscanf(assignment, "%31[^=]", name);
    get_field(message, axes, name, value, sizeof value);
    return strcmp(value, assignment + strlen(name) + 1) == 0;
}
