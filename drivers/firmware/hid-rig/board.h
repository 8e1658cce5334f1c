/* The rig: what is fastened to which pin of a Teensy 4, and its mechanics. Change this file for a rig of your own. */
#ifndef BOARD_H
#define BOARD_H

enum {
    PIN_ENCODER_A = 2, /* leads B while the count grows */
    PIN_ENCODER_B = 3,
    PIN_MOTOR_PWM = 4, /* with a pull-down resistor: it floats while the processor is in reset */
    PIN_MOTOR_DIRECTION = 5, /* high pushes towards growing counts */
    PIN_HOME_SWITCH = 6,     /* to ground, at the lower end stop */
    PIN_BUTTON = 7,          /* to ground */
    PIN_TTL_INPUT = 8,       /* 3.3 V at most, which is all that a Teensy 4 bears; high when nothing is connected */
    PIN_SYNC_OUTPUT = 9,     /* 3.3 V: turns when a position is taken for a tick */
};

#define PWM_HZ 20000.0f
#define PWM_BITS 11

/* 4096 counts a turn on a drum of 10 mm: pi * 10 mm / 4096 = 7.669904 um a count at the handle. */
#define COUNT_PM 7669904UL
/* Force at the handle with PWM at 100 %: torque constant * full current / drum radius. Measure it with a scale. */
#define MAX_FORCE_UN 5000000UL
/* 100 mm between the end stops. */
#define LOWEST_COUNTS (-6500)
#define HIGHEST_COUNTS 6500

#define HOST_SILENCE_MS 20
#define NOMINAL_RATE_HZ 1000
#define MODEL "hid-rig"
#define SERIAL "0001"

#endif
