/* The drd half of the fake SDK. It links to the dhd half, so that both are one bench whatever handle they came by. */
#include "fake.h"

#include <errno.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

static int held_by_another(struct device *d) {
    pid_t holder = (pid_t)d->holder;
    return holder && holder != getpid() && !(kill(holder, 0) && errno == ESRCH); /* a dead one holds nothing */
}

int drdOpenID(char ID) {
    log_call(__func__);
    if (bench->count < 1)
        return fail(NO_DEVICE);
    if (ID < 0 || ID >= bench->count || !bench->device[(int)ID].present)
        return fail(BAD_INDEX);
    struct device *d = &bench->device[(int)ID];
    if (held_by_another(d))
        return fail(IN_USE);
    if (d->refuses)
        return fail((int)d->refuses);
    if (!d->calibrated)
        d->mode = RESET;
    d->holder = getpid();
    note_processors(d);
    d->started = d->updates = 0;
    open_here[(int)ID] = 1;
    heard(d);
    return ID;
}

int drdClose(char ID) {
    log_call(__func__);
    if (ID < 0 || ID >= DEVICES || !open_here[(int)ID])
        return fail(BAD_INDEX);
    open_here[(int)ID] = 0;
    bench->device[(int)ID].holder = 0;
    return 0;
}

bool drdIsSupported(char ID) {
    log_call(__func__);
    struct device *d = device_of(ID);
    return d && d->type != FALCON;
}

bool drdIsInitialized(char ID) {
    log_call(__func__);
    struct device *d = device_of(ID);
    return d && d->calibrated && d->type != FALCON;
}

/* Moves the arm, takes its time, and sends no force commands: a watchdog that is on stops it half way. */
int drdAutoInit(char ID) {
    log_call(__func__);
    struct device *d = device_of(ID);
    if (!d)
        return -1;
    note_processors(d);
    d->moves++;
    d->mode = FORCE;
    d->regulating = 1;
    heard(d);
    for (double left_us = d->auto_init_us; left_us > 0; left_us -= 1000) {
        nanosleep(&(struct timespec){0, left_us < 1000 ? (long)(left_us * 1e3) : 1000000}, 0);
        pass(1000);
        if (!d->regulating || settle(d) < 0 || d->mode != FORCE) /* drdStop from another thread, or the watchdog */
            return fail(TIMEOUT);
    }
    if (d->auto_init_fails)
        return fail(TIMEOUT);
    d->calibrated = d->regulating = 1;
    for (int axis = 0; axis < 3; axis++)
        d->position_m[axis] = d->velocity_m_per_s[axis] = 0;
    return 0;
}

int drdStop(bool frc, char ID) {
    log_call(__func__);
    struct device *d = device_of(ID);
    if (!d)
        return -1;
    d->regulating = 0;
    if (!frc)
        trip(d, SOFTWARE);
    return 0;
}
