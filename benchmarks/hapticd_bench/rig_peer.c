/* The far end of a serial line, for `hapticd bench rig`; standard input is the line.
 *
 *   rig_peer rig    a rig that knows its home: the firmware's protocol core
 *   rig_peer raw    answers whatever comes with as many bytes as a STATE has on the line */
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "host_rig.h"
#include "message.h"

enum { STATE_BYTES = 26, SIZE = 4096, SILENCE_MS = 60000, IDLE_MS = 1, PRIORITY = 85 };

static uint32_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)(now.tv_sec * 1000000 + now.tv_nsec / 1000);
}

int main(int count, char **words)
{
    static const uint8_t ANSWER[STATE_BYTES] = {1, 1};
    int raw = count == 2 && strcmp(words[1], "raw") == 0;
    struct host_rig *rig = host_rig_new(1);
    if (rig == NULL) {
        return 1;
    }
    /* Where that is allowed: a rig has a processor of its own, and does not wait on this one. */
    sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = PRIORITY});
    host_rig_description(rig)->capabilities = RIG_KNOWS_HOME;
    host_rig_description(rig)->host_silence_ms = SILENCE_MS;
    host_rig_restart(rig);
    for (;;) {
        struct pollfd line = {.fd = 0, .events = POLLIN};
        uint8_t bytes[SIZE];
        poll(&line, 1, IDLE_MS);
        if (line.revents & POLLNVAL) {
            return 0;
        }
        ssize_t length = line.revents & POLLIN ? read(0, bytes, sizeof bytes) : 0;
        host_rig_clock(rig, now_us());
        if (length > 0) {
            host_rig_write(rig, bytes, (size_t)length);
        }
        length = raw ? (length > 0 ? STATE_BYTES : 0) : (ssize_t)host_rig_read(rig, bytes, sizeof bytes);
        if (length > 0 && write(0, raw ? ANSWER : bytes, (size_t)length) < 0) {
            return 0;
        }
    }
}
