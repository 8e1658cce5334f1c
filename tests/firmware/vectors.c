/* The codec and the refusals against vectors.txt: vectors FILE. Prints what fails; the exit status says whether. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cobs.h"
#include "crc16.h"
#include "fields.h"
#include "frame.h"
#include "host_rig.h"
#include "report.h"

enum { WORDS = 32 };

static unsigned checks, failures;
static unsigned line_number;

static void check(bool holds, const char *what)
{
    checks++;
    if (!holds) {
        failures++;
        fprintf(stderr, "line %u: %s\n", line_number, what);
    }
}

static void check_crc(char **words)
{
    uint8_t bytes[512];
    unsigned length = unhex(words[1], bytes, sizeof bytes);
    check(crc16(bytes, length) == strtoul(words[2], NULL, 16), "CRC");
}

static void check_cobs(char **words)
{
    uint8_t plain[64], encoded[65], made[65];
    unsigned length = unhex(words[1], plain, sizeof plain);
    unsigned encoded_length = unhex(words[2], encoded, sizeof encoded);
    check(cobs_encode(plain, (uint8_t)length, made) == encoded_length, "encoded length");
    check(memcmp(made, encoded, encoded_length) == 0, "encoded bytes");
    check(cobs_decode(encoded, (uint8_t)encoded_length) == (int16_t)length, "decoded length");
    check(memcmp(encoded, plain, length) == 0, "decoded bytes");
}

static void check_uncobs(char **words)
{
    uint8_t bytes[512];
    unsigned length = unhex(words[1], bytes, sizeof bytes);
    check(cobs_decode(bytes, (uint8_t)length) < 0, "was taken for an encoding");
}

/* The message, its frame and its report are one and the same, and its fields are where the page says. */
static void check_message(char **words)
{
    struct message message = {.length = 0};
    struct frame_receiver receiver = {.collected = 0};
    uint8_t wire[FRAME_MAX], made[FRAME_MAX], report[REPORT_SIZE];
    unsigned axes = 1;
    message.length = (uint8_t)unhex(words[2], message.bytes, sizeof message.bytes);
    unsigned wire_length = unhex(words[3], wire, sizeof wire);

    check(frame_make(message.bytes, message.length, made) == wire_length, "frame length");
    check(memcmp(made, wire, wire_length) == 0, "frame bytes");
    for (unsigned i = 0; i + 1 < wire_length; i++) {
        check(frame_receive(&receiver, wire[i]) == FRAME_NOTHING, "a message before its end");
    }
    check(frame_receive(&receiver, 0) == FRAME_MESSAGE, "no message at its end");
    check(receiver.length == message.length && memcmp(receiver.bytes, message.bytes, message.length) == 0,
          "another message");
    report_make(message.bytes, message.length, report);
    check(report_message(report) == message.length && memcmp(report + 1, message.bytes, message.length) == 0,
          "another report");

    for (char **word = words + 4; *word != NULL; word++) {
        sscanf(*word, "axes=%u", &axes);
        if (strncmp(*word, "force1=", 7) == 0 || strncmp(*word, "force2=", 7) == 0) {
            axes = (unsigned)(word[0][5] - '0') + 1;
        }
    }
    check(is_message(words[1], axes, &message), "type, length or CRC");
    for (char **word = words + 4; *word != NULL; word++) {
        bool about_the_line = strncmp(*word, "axes=", 5) == 0 && strcmp(words[1], "STATE") == 0;
        check(about_the_line || has_field(&message, axes, *word), *word);
    }
}

/* Once HELLO has been said, or not, what does the rig answer to these bytes? */
static struct message answer_to(const char *hex, struct host_rig *host)
{
    uint8_t bytes[512];
    struct message answer = {.length = 0};
    host_rig_write(host, bytes, unhex(hex, bytes, sizeof bytes));
    answer.length = host_rig_read_message(host, answer.bytes);
    return answer;
}

static void check_damaged(char **words)
{
    struct host_rig *host = host_rig_new(1);
    struct message ping, answer;
    uint8_t frame[FRAME_MAX];
    check(answer_to("0401016403aa0200", host).length != 0, "no IDENTITY");
    check(answer_to(words[2], host).length == 0, "was answered");
    host_message("PING", 1, &ping);
    set_field(&ping, 1, "sequence=101");
    host_rig_write(host, frame, frame_make(ping.bytes, ping.length, frame));
    answer.length = host_rig_read_message(host, answer.bytes);
    check(answer.length == 26 && has_field(&answer, 1, "damaged=1"), "was not counted once");
    host_rig_free(host);
}

static void check_refused(char **words)
{
    char reason[32];
    struct host_rig *host = host_rig_new(1);
    struct message answer = answer_to(words[2], host);
    snprintf(reason, sizeof reason, "reason=%.10s", words[1]);
    check(is_message("REFUSED", 1, &answer) && has_field(&answer, 1, reason), "was not refused for that reason");
    check(has_field(&answer, 1, "echo=0"), "a refused message was echoed");
    host_rig_free(host);
}

static void check_stream(char **words)
{
    uint8_t bytes[512];
    struct frame_receiver receiver = {.collected = 0};
    unsigned length = unhex(words[1], bytes, sizeof bytes);
    char **next = words + 2;
    for (unsigned i = 0; i < length; i++) {
        if (frame_receive(&receiver, bytes[i]) != FRAME_MESSAGE || receiver.length < RIG_MESSAGE_MIN) {
            continue;
        }
        uint16_t crc = get_u16(receiver.bytes + receiver.length - 2);
        if (crc != crc16(receiver.bytes, receiver.length - 2u)) {
            continue;
        }
        uint8_t expected[64];
        unsigned expected_length = *next == NULL ? 0 : unhex(*next, expected, sizeof expected);
        check(*next != NULL && receiver.length == expected_length &&
                  memcmp(receiver.bytes, expected, expected_length) == 0,
              "another message was found");
        next += *next != NULL;
    }
    check(*next == NULL, "a message was not found");
}

int main(int argc, char **argv)
{
    static const struct {
        const char *word;
        void (*check)(char **words);
    } KINDS[] = {
        {"crc", check_crc},         {"cobs", check_cobs},       {"uncobs", check_uncobs}, {"host", check_message},
        {"device", check_message},  {"damaged", check_damaged}, {"refused", check_refused}, {"stream", check_stream},
    };
    static char line[8192];
    FILE *file = argc == 2 ? fopen(argv[1], "r") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: vectors FILE\n");
        return 2;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        char *words[WORDS] = {NULL};
        unsigned count = 0;
        line_number++;
        for (char *word = strtok(line, " \n"); word != NULL && count < WORDS - 1; word = strtok(NULL, " \n")) {
            words[count++] = word;
        }
        if (count == 0 || words[0][0] == '#') {
            continue;
        }
        unsigned kind = 0;
        while (kind < sizeof KINDS / sizeof *KINDS && strcmp(KINDS[kind].word, words[0]) != 0) {
            kind++;
        }
        if (kind == sizeof KINDS / sizeof *KINDS) {
            check(false, "no such kind of vector");
        } else {
            KINDS[kind].check(words);
        }
    }
    fclose(file);
    printf("%u checks, %u failed\n", checks, failures);
    return failures != 0 || checks < 100;
}
