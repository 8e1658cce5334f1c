/* A rig on the desk that is none: the real firmware on a simulated ATmega328P, a handle of one mass behind its pins,
 * its serial line on a pty. Commands come on stdin, one a line, and each is answered by one line on stdout.
 *
 *   board WIRING FIRMWARE.elf PACE LINK
 *
 * WIRING is uno or hapkit.
 * PACE says how simulated time passes:
 *   real     with the clock, but never faster: a machine that is late makes the rig slow, it does not replay
 *   frames   1 ms for each frame from the host, which is heard when that begins; after 0.3 s without one, with the clock
 *   patient  the same, after 30 s without one
 *   steps    only by the command `run`
 * LINK is a symbolic link to the pty that is there while the rig is plugged in.
 *
 * simavr is GPL-3.0-or-later: this is built by the tests and shipped with nothing. */
#define _GNU_SOURCE
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include "handle.h"
#include "line.h"
#include "processor.h"
#include "wiring.h"

static const double FRAME_US = 1000.0;      /* what a frame is worth at the pace of frames */
static const double PATIENCE_US = 300000.0; /* after which silence is no late host but a silent one */
static const double LONGER_US = 30e6;       /* and where none falls silent on purpose */
static const double BEHIND_US = 2000.0;     /* that real time may be ahead before the rig gives up following */
static const double PART_US = 200.0;        /* between two looks at the line */

enum pace { REAL, FRAMES, PATIENT, STEPS };

static struct handle handle;
static struct processor *processor;
static const char *port;
static double time_us; /* simulated, through resets and unplugging */
static double heard_us; /* real time of the last byte taken */

static double now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e6 + (double)now.tv_nsec * 1e-3;
}

static void plug(void)
{
    line_plug(port);
    processor_switch_on(processor);
}

static void unplug(void)
{
    line_unplug();
    processor_switch_off(processor);
}

static bool plugged(void)
{
    return line_descriptor() >= 0;
}

static void take(void)
{
    unsigned long before = line_taken();
    if (plugged()) {
        line_take();
    }
    if (line_taken() != before) {
        heard_us = now_us();
    }
}

/* Let time pass: for a part at most, so that what the rig says is given. */
static void live_part(double us)
{
    for (double end_us = time_us + us; time_us < end_us;) {
        if (!plugged()) {
            handle_move(&handle, 1e-6);
            time_us += 1.0;
            continue;
        }
        int byte = processor_listens(processor) ? line_next() : -1;
        if (byte >= 0) {
            processor_hear(processor, (uint8_t)byte);
        }
        time_us += processor_run(processor);
        while ((byte = processor_said(processor)) >= 0) {
            line_put((uint8_t)byte);
        }
    }
    if (plugged()) {
        line_give();
    }
}

static void live(double us)
{
    for (; us > 0.0; us -= PART_US) {
        live_part(fmin(us, PART_US));
    }
}

/* A pty hands bytes over in its own time: first wait for all that the host says it has written. */
static void run(double us, unsigned long written)
{
    while (plugged() && line_taken() < written) {
        struct pollfd source = {line_descriptor(), POLLIN, 0};
        poll(&source, 1, -1);
        take();
    }
    for (; us > 0.0; us -= PART_US) {
        take();
        line_let_all();
        live_part(fmin(us, PART_US));
    }
}

/* A host that was late sends many at once: they are heard as if it had not been. */
static void live_frames(void)
{
    for (unsigned long frames = line_frames(); frames > 0; frames--) {
        line_let_frame();
        live(FRAME_US);
    }
}

static void obey(const char *command)
{
    double a = 0.0, b = 0.0, c = 0.0;
    char word[32] = "";
    sscanf(command, "%31s %lf %lf %lf", word, &a, &b, &c);
    if (strcmp(word, "state") == 0) {
        printf("%.1f %.9g %.9g %.9g %ld %u\n", time_us, handle.position_m, handle.velocity_m_per_s, handle.motor_n,
               handle.shown, processor_resets(processor));
        return;
    }
    if (strcmp(word, "syncs") == 0) {
        printf("%u\n", processor_syncs(processor));
        return;
    }
    if (strcmp(word, "run") == 0) {
        run(a, (unsigned long)b);
        printf("%lu\n", line_given());
        return;
    }
    if (strcmp(word, "hand") == 0) {
        handle.hand_n = a;
    } else if (strcmp(word, "grip") == 0) {
        handle.grip_stiffness_n_per_m = a;
        handle.grip_damping_n_s_per_m = b;
        handle.grip_rest_m = c;
    } else if (strcmp(word, "plant") == 0) {
        handle.mass_kg = a;
        handle.damping_n_s_per_m = b;
    } else if (strcmp(word, "place") == 0) {
        handle_place(&handle, a);
    } else if (strcmp(word, "reversed") == 0) {
        handle.reversed = a != 0.0;
    } else if (strcmp(word, "broken-wire") == 0) {
        handle.broken_wire = a != 0.0;
    } else if (strcmp(word, "phase-error") == 0) {
        handle.phase_error_deg = a;
    } else if (strcmp(word, "magnet") == 0) {
        handle.offset += (long)a;
    } else if (strcmp(word, "bend") == 0) {
        handle.bend = a;
    } else if (strcmp(word, "button") == 0) {
        handle.button = a != 0.0;
    } else if (strcmp(word, "ttl") == 0) {
        handle.ttl = a != 0.0;
    } else if (strcmp(word, "hang") == 0 && plugged()) {
        processor_hang(processor);
    } else if (strcmp(word, "unplug") == 0 && plugged()) {
        unplug();
    } else if (strcmp(word, "plug") == 0 && !plugged()) {
        plug();
    } else {
        printf("not understood: %s\n", command);
        return;
    }
    printf("ok\n");
}

static void take_commands(void)
{
    static char text[4096];
    static size_t length;
    ssize_t got = read(STDIN_FILENO, text + length, sizeof text - 1 - length);
    if (got <= 0) {
        if (plugged()) {
            unplug();
        }
        exit(0);
    }
    length += (size_t)got;
    text[length] = '\0';
    for (char *end; (end = strchr(text, '\n')) != NULL;) {
        *end = '\0';
        obey(text);
        length -= (size_t)(end + 1 - text);
        memmove(text, end + 1, length + 1);
    }
    fflush(stdout);
}

static void wait_for_something(enum pace pace)
{
    struct pollfd sources[2] = {{STDIN_FILENO, POLLIN, 0}, {line_has_room() ? line_descriptor() : -1, POLLIN, 0}};
    struct timespec longest = {0, pace == REAL ? 100000 : 1000000};
    ppoll(sources, pace == STEPS ? 1 : 2, pace == STEPS ? NULL : &longest, NULL);
    if (sources[0].revents) {
        take_commands();
    }
}

int main(int argc, char **argv)
{
    static const char *const PACES[] = {[REAL] = "real", [FRAMES] = "frames", [PATIENT] = "patient", [STEPS] = "steps"};
    static const struct wiring *const WIRINGS[] = {&UNO, &HAPKIT};
    const struct wiring *wiring = NULL;
    int pace = -1;
    for (int i = 0; argc == 5 && i < 2; i++) {
        wiring = strcmp(argv[1], WIRINGS[i]->name) == 0 ? WIRINGS[i] : wiring;
    }
    for (int i = REAL; argc == 5 && i <= STEPS; i++) {
        pace = strcmp(argv[3], PACES[i]) == 0 ? i : pace;
    }
    if (pace < 0 || wiring == NULL) {
        fprintf(stderr, "usage: board uno|hapkit FIRMWARE.elf real|frames|patient|steps LINK\n");
        return 2;
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (pace != STEPS) { /* a board has a processor of its own; where this user may */
        sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){.sched_priority = 1});
    }
    handle = wiring->handle;
    processor = processor_new(argv[2], wiring, &handle);
    port = argv[4];
    plug();
    printf("ready\n");
    fflush(stdout);

    for (double lived_us = now_us();;) { /* real time that the rig has followed */
        wait_for_something((enum pace)pace);
        if (pace == STEPS) {
            continue;
        }
        take();
        double real_us = now_us();
        double due_us = fmin(real_us - lived_us, BEHIND_US);
        lived_us = real_us;
        if (pace == REAL) {
            run(due_us, 0);
        } else if (real_us - heard_us > (pace == PATIENT ? LONGER_US : PATIENCE_US)) {
            line_let_all(); /* what has been heard and is no frame; what comes meanwhile may be one */
            live(due_us);
        }
        if (pace != REAL) {
            live_frames();
        }
    }
}
