/* A rig on USB that is not there: the protocol core behind a hidraw node, with a plant, told by lines what to do.
 *
 * It prints the directory that clients need as UMOCKDEV_DIR, then answers each line of its input with one line. */
#define _GNU_SOURCE
#include <poll.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bed.h"
#include "host_rig.h"
#include "plant.h"

enum { FORCE = 0x07, FORCES = 4096, LINE = 400, NAP_NS = 200000 };

static const double M_PER_PM = 1e-12;
static const double N_PER_UN = 1e-6;
static const double MESSAGE_S = 0.001;
static const double LONGEST_STEP_S = 1.0; /* a computer that was stopped for longer makes up for this much */

struct rig_on_usb {
    struct bed *bed;
    struct host_rig *host;
    struct rig_description *about;
    struct plant plant[RIG_AXES];
    double count_0_m[RIG_AXES]; /* where it stood when it was switched on; 0 when its sensor knows better */
    double switch_m;            /* the home switch is closed below */
    double switched_on_s, now_s;
    double frames_s; /* at the pace of messages: time, a millisecond of which passes with each; 0 with the clock */
    bool plugged, mute;
    int sequence; /* of the last message that came; -1: none */
    int32_t forces_un[FORCES]; /* of the first axis, as they came */
    size_t forces;
    int32_t peak_un; /* largest force of the first axis since it was asked for */
};

static double clock_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static void move_on(struct rig_on_usb *rig)
{
    double now_s = rig->frames_s > 0.0 ? rig->frames_s : clock_s();
    double time_s = now_s - rig->now_s < LONGEST_STEP_S ? now_s - rig->now_s : LONGEST_STEP_S;
    rig->now_s = now_s;
    for (uint8_t axis = 0; axis < rig->about->axes; axis++) {
        struct plant *plant = &rig->plant[axis];
        int32_t force_un = rig->plugged ? abs(host_rig_force(rig->host, axis)) : 0;
        rig->peak_un = axis == 0 && force_un > rig->peak_un ? force_un : rig->peak_un;
        plant_advance(plant, rig->plugged ? host_rig_force(rig->host, axis) * N_PER_UN : 0.0, time_s);
        double count_m = rig->about->axis[axis].count_pm * M_PER_PM;
        host_rig_set_position(rig->host, axis, (int32_t)((plant->x_m - rig->count_0_m[axis]) / count_m));
    }
    host_rig_set_home_switch(rig->host, rig->plant[0].x_m < rig->switch_m);
    if (rig->plugged) {
        host_rig_clock(rig->host, (uint32_t)(uint64_t)((now_s - rig->switched_on_s) * 1e6));
    }
}

static void switch_on(struct rig_on_usb *rig)
{
    rig->switched_on_s = rig->now_s;
    for (uint8_t axis = 0; axis < rig->about->axes; axis++) {
        rig->count_0_m[axis] = rig->about->capabilities & RIG_KNOWS_HOME ? 0.0 : rig->plant[axis].x_m;
    }
    host_rig_restart(rig->host);
    rig->plugged = true;
    move_on(rig);
}

static void talk(struct rig_on_usb *rig)
{
    uint8_t report[OUTPUT_REPORT];
    while (bed_receive(rig->bed, report)) {
        const uint8_t *message = report + 2;
        rig->sequence = message[2] | message[3] << 8;
        if (message[1] == FORCE && rig->forces < FORCES) {
            memcpy(&rig->forces_un[rig->forces++], message + 6, sizeof(int32_t));
        }
        move_on(rig);
        host_rig_write_report(rig->host, report + 1, REPORT);
        if (rig->frames_s > 0.0) {
            rig->frames_s += MESSAGE_S;
            move_on(rig);
        }
    }
    while (host_rig_read_report(rig->host, report)) {
        if (!rig->mute) {
            bed_send(rig->bed, report, REPORT);
        }
    }
    bed_work(rig->bed);
}

static void set(struct rig_on_usb *rig, const char *what, double value, int axis)
{
    struct plant *plant = &rig->plant[axis];
    if (!strcmp(what, "x_m")) {
        *plant = (struct plant){.x_m = value, .hand_n = plant->hand_n, .motor_sign = plant->motor_sign};
    } else if (!strcmp(what, "hand_n")) {
        plant->hand_n = value;
    } else if (!strcmp(what, "motor_sign")) {
        plant->motor_sign = value;
    } else if (!strcmp(what, "switch_m")) {
        rig->switch_m = value;
    } else if (!strcmp(what, "silence_ms")) {
        rig->about->host_silence_ms = (uint16_t)value;
    } else if (!strcmp(what, "capabilities")) {
        rig->about->capabilities = (uint8_t)value;
    } else if (!strcmp(what, "buttons")) {
        host_rig_set_buttons(rig->host, (uint16_t)value);
    } else if (!strcmp(what, "frames")) {
        rig->frames_s = rig->now_s;
    } else if (!strcmp(what, "mute")) {
        rig->mute = value != 0.0;
    } else {
        fprintf(stderr, "hid_double: what is %s?\n", what);
        exit(1);
    }
}

static void send_hex(struct rig_on_usb *rig, const char *digits)
{
    uint8_t bytes[LINE];
    size_t length = 0;
    for (unsigned byte; sscanf(digits + 2 * length, "%2x", &byte) == 1; length++) {
        bytes[length] = (uint8_t)byte;
    }
    bed_send(rig->bed, bytes, length);
}

/* Carry out a line and print its answer; false when it was the last. */
static bool obey(struct rig_on_usb *rig, char *line)
{
    char word[LINE] = "", what[LINE] = "";
    double value = 0.0;
    int axis = 0, detail = 0;
    sscanf(line, "%s %s %lf %d", word, what, &value, &axis);
    if (!strcmp(word, "look")) {
        axis = atoi(what);
        printf("%d %.9f %.9f %d", host_rig_force(rig->host, (uint8_t)axis), rig->plant[axis].x_m,
               rig->plant[axis].v_m_per_s, rig->sequence);
    } else if (!strcmp(word, "forces")) {
        for (size_t i = 0; i < rig->forces; i++) {
            printf("%d ", rig->forces_un[i]);
        }
        rig->forces = 0;
    } else if (!strcmp(word, "peak")) {
        printf("%d", rig->peak_un);
        rig->peak_un = 0;
    } else if (!strcmp(word, "set")) {
        set(rig, what, value, axis);
    } else if (!strcmp(word, "send")) {
        send_hex(rig, what);
    } else if (!strcmp(word, "break") && sscanf(line, "break %lf %d %d", &value, &axis, &detail) == 3) {
        host_rig_break(rig->host, (uint8_t)value, (uint8_t)axis, detail);
    } else if (!strcmp(word, "mend")) {
        host_rig_mend(rig->host);
    } else if (!strcmp(word, "hold")) {
        bed_hold(rig->bed);
    } else if (!strcmp(word, "release")) {
        bed_release(rig->bed);
    } else if (!strcmp(word, "unplug")) {
        rig->plugged = false;
        bed_unplug(rig->bed);
    } else if (!strcmp(word, "plug")) {
        bed_plug(rig->bed, what);
        switch_on(rig);
    } else if (!strcmp(word, "restart")) {
        switch_on(rig);
    } else {
        return false;
    }
    printf("\n");
    fflush(stdout);
    return true;
}

int main(int count, char **arguments)
{
    static struct rig_on_usb rig;
    /* A rig has a processor of its own; where that may be had, so does this one in effect. */
    struct sched_param soon = {.sched_priority = 1};
    (void)sched_setscheduler(0, SCHED_FIFO, &soon);
    rig.host = host_rig_new((uint8_t)(count > 1 ? atoi(arguments[1]) : 1));
    rig.bed = bed_new();
    rig.about = host_rig_description(rig.host);
    rig.now_s = clock_s();
    rig.switch_m = -1.0;
    rig.sequence = -1;
    for (int axis = 0; axis < RIG_AXES; axis++) {
        rig.plant[axis].motor_sign = 1.0;
    }
    printf("%s\n", bed_directory(rig.bed));
    fflush(stdout);
    char line[LINE];
    do {
        move_on(&rig);
        talk(&rig);
        struct pollfd waiting[] = {{.fd = 0, .events = POLLIN}, {.fd = bed_descriptor(rig.bed), .events = POLLIN}};
        struct timespec nap = {0, NAP_NS};
        ppoll(waiting, 2, &nap, NULL);
        line[0] = '\0';
        if (waiting[0].revents && fgets(line, sizeof line, stdin) == NULL) {
            break;
        }
    } while (line[0] == '\0' || obey(&rig, line));
    bed_free(rig.bed);
    host_rig_free(rig.host);
}
