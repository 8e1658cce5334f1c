/* The device's state machine against sessions.txt: sessions FILE line|reports. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fields.h"
#include "frame.h"
#include "host_rig.h"
#include "report.h"

enum { AXES = 1 };

static unsigned checks, failures;
static unsigned line_number;
static char session[1024];
static bool reports;
static bool skipped; /* this session is about the other transport */
static struct host_rig *host;
static uint32_t next_sequence;

static void check(bool holds, const char *what)
{
    checks++;
    if (!holds) {
        failures++;
        fprintf(stderr, "line %u (%s): %s\n", line_number, session, what);
    }
}

static struct message receive(void)
{
    struct message message = {.length = 0};
    if (reports) {
        uint8_t report[REPORT_SIZE];
        if (host_rig_read_report(host, report)) {
            message.length = report_message(report);
            memcpy(message.bytes, report + 1, message.length);
        }
        return message;
    }
    struct frame_receiver receiver = {.collected = 0};
    uint8_t byte;
    while (host_rig_read(host, &byte, 1) == 1) {
        if (frame_receive(&receiver, byte) == FRAME_MESSAGE) {
            message.length = receiver.length;
            memcpy(message.bytes, receiver.bytes, receiver.length);
            break;
        }
    }
    return message;
}

static void expect_silence(void)
{
    check(receive().length == 0, "it has said more than it should");
}

static void say(char *name)
{
    struct message message;
    char sequence[32];
    check(host_message(name, AXES, &message), "not a message to a device");
    snprintf(sequence, sizeof sequence, "sequence=%" PRIu32, next_sequence & 0xffff);
    set_field(&message, AXES, sequence);
    for (char *field = strtok(NULL, " "); field != NULL; field = strtok(NULL, " ")) {
        set_field(&message, AXES, field);
        sscanf(field, "sequence=%" SCNu32, &next_sequence);
    }
    next_sequence++;
    if (reports) {
        uint8_t report[REPORT_SIZE];
        report_make(message.bytes, message.length, report);
        host_rig_write_report(host, report, sizeof report);
    } else {
        uint8_t frame[FRAME_MAX];
        host_rig_write(host, frame, frame_make(message.bytes, message.length, frame));
    }
}

static void expect(const char *name)
{
    struct message message = receive();
    check(message.length != 0, "it has said nothing");
    if (message.length == 0) {
        return;
    }
    bool right = is_message(name, AXES, &message);
    check(right, "it has said something else");
    for (char *field = strtok(NULL, " "); right && field != NULL; field = strtok(NULL, " ")) {
        check(has_field(&message, AXES, field), field);
    }
}

static void begin(const char *name)
{
    host_rig_free(host);
    host = host_rig_new(AXES);
    next_sequence = 1;
    snprintf(session, sizeof session, "%s", name);
    const char *other = reports ? "on a line," : "in reports,";
    skipped = strncmp(name, other, strlen(other)) == 0;
}

static void obey(char *line)
{
    uint32_t number = 0;
    unsigned fault, axis;
    int32_t counts = 0;
    char whole[1024];
    snprintf(whole, sizeof whole, "%s", line);
    char *word = strtok(line, " ");
    if (strcmp(word, "<") == 0) {
        expect(strtok(NULL, " "));
        return;
    }
    if (sscanf(whole, "motor %" SCNd32, &counts) == 1) {
        check(host_rig_force(host, 0) == counts, "the motor is told something else");
        return;
    }
    if (sscanf(whole, "syncs %" SCNu32, &number) == 1) {
        check(host_rig_syncs(host) == number, "the sync output has turned another number of times");
        return;
    }
    if (host != NULL) {
        expect_silence();
    }
    if (strcmp(word, "session") == 0) {
        begin(whole + strlen("session "));
    } else if (strcmp(word, ">") == 0) {
        say(strtok(NULL, " "));
    } else if (strcmp(word, "wire") == 0) {
        uint8_t bytes[512];
        host_rig_write(host, bytes, unhex(strtok(NULL, " "), bytes, sizeof bytes));
    } else if (strcmp(word, "report") == 0) {
        uint8_t bytes[512];
        host_rig_write_report(host, bytes, unhex(strtok(NULL, " "), bytes, sizeof bytes));
    } else if (sscanf(whole, "at %" SCNu32, &number) == 1) {
        host_rig_clock(host, number);
    } else if (sscanf(whole, "stalled %" SCNu32, &number) == 1) {
        host_rig_stall(host, number);
    } else if (sscanf(whole, "position %" SCNd32, &counts) == 1) {
        host_rig_set_position(host, 0, counts);
    } else if (sscanf(whole, "buttons %" SCNu32, &number) == 1) {
        host_rig_set_buttons(host, (uint16_t)number);
    } else if (sscanf(whole, "switch %" SCNu32, &number) == 1) {
        host_rig_set_home_switch(host, number != 0);
    } else if (sscanf(whole, "fault %u %u %" SCNd32, &fault, &axis, &counts) == 3) {
        host_rig_break(host, (uint8_t)fault, (uint8_t)axis, counts);
    } else if (strcmp(word, "mended") == 0) {
        host_rig_mend(host);
    } else if (strcmp(word, "restart") == 0) {
        host_rig_restart(host);
    } else {
        check(false, "not understood");
    }
}

int main(int argc, char **argv)
{
    static char line[4096];
    FILE *file = argc == 3 ? fopen(argv[1], "r") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: sessions FILE line|reports\n");
        return 2;
    }
    reports = strcmp(argv[2], "reports") == 0;
    while (fgets(line, sizeof line, file) != NULL) {
        line_number++;
        line[strcspn(line, "\n")] = '\0';
        bool begins = strncmp(line, "session ", strlen("session ")) == 0;
        if (line[0] != '\0' && line[0] != '#' && (begins || !skipped)) {
            obey(line);
        }
    }
    expect_silence();
    host_rig_free(host);
    fclose(file);
    printf("%u checks, %u failed\n", checks, failures);
    return failures != 0 || checks < 100;
}
