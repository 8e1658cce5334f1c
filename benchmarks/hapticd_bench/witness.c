/* The simplest loop there is: sleep to each whole millisecond, write down how late it was.
 *
 *     witness CPU PRIORITY TICKS FILE
 *
 * At a higher priority than a loop on the same processor it is the loop's witness: what the machine does at an instant
 * hits both, and what is left of their difference is the loop's own. In the place of the loop it is the reference.
 * Prints "ready" before its first deadline; writes TICKS pairs (deadline, lateness) of 64-bit integers [ns of
 * CLOCK_MONOTONIC] to FILE when it is done. Skipped deadlines leave no pair. PRIORITY 0 asks for no rights at all.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define PERIOD 1000000LL
#define SECOND 1000000000LL

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * SECOND + t.tv_nsec;
}

static int fail(const char *what)
{
    fprintf(stderr, "%s: %s\n", what, strerror(errno));
    return 1;
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: witness CPU PRIORITY TICKS FILE\n");
        return 2;
    }
    int cpu = atoi(argv[1]);
    struct sched_param priority = {.sched_priority = atoi(argv[2])};
    long ticks = atol(argv[3]);
    FILE *file = fopen(argv[4], "wb");
    if (!file)
        return fail(argv[4]);

    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(cpu, &set);
    if (sched_setaffinity(0, sizeof set, &set))
        return fail("sched_setaffinity");
    int32_t zero = 0;
    int hold = -1; /* stays open: closing it gives the hold up */
    if (priority.sched_priority) {
        if (mlockall(MCL_CURRENT | MCL_FUTURE))
            return fail("mlockall");
        hold = open("/dev/cpu_dma_latency", O_RDWR);
        if (hold < 0 || write(hold, &zero, sizeof zero) != sizeof zero)
            return fail("/dev/cpu_dma_latency");
    }
    int64_t *record = malloc(2 * ticks * sizeof *record);
    if (!record)
        return fail("malloc");
    memset(record, 0, 2 * ticks * sizeof *record); /* no first touch later */
    if (priority.sched_priority && sched_setscheduler(0, SCHED_FIFO, &priority))
        return fail("sched_setscheduler");
    puts("ready");
    fflush(stdout);

    int64_t deadline = now_ns() / PERIOD * PERIOD + 5 * PERIOD;
    for (long k = 0; k < ticks; k++) {
        struct timespec t = {deadline / SECOND, deadline % SECOND};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL))
            ;
        int64_t woke = now_ns();
        record[2 * k] = deadline;
        record[2 * k + 1] = woke - deadline;
        do
            deadline += PERIOD;
        while (deadline < woke);
    }

    if (fwrite(record, 2 * sizeof *record, ticks, file) != (size_t)ticks || fclose(file))
        return fail(argv[4]);
    return 0;
}
