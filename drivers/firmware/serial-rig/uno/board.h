/* The rig: what is fastened to which pin, and its mechanics. Change this file for a rig of your own.
 *
 *   PD0 RX, PD1 TX      serial line to the host
 *   PD2 A, PD3 B        quadrature encoder of the motor; A leads B while the count grows
 *   PB1                 PWM, 20 kHz: share of full current
 *   PB2                 direction: high pushes towards growing counts
 *   PD4                 home switch to ground, at the lower end stop
 *   PD5                 push button to ground
 *   PD6                 TTL input, 5 V; high when nothing is connected
 *   PD7                 sync output, 5 V: turns when a position is taken for a tick
 *
 * Put a pull-down resistor on PB1: the pin floats while the processor is in reset, and the motor must be off then. */
#ifndef BOARD_H
#define BOARD_H

#define BAUD 1000000UL

/* 4096 counts a turn on a drum of 10 mm: pi * 10 mm / 4096 = 7.669904 um a count at the handle. */
#define COUNT_PM 7669904UL
/* Force at the handle with PWM at 100 %: torque constant * full current / drum radius. Measure it with a scale. */
#define MAX_FORCE_UN 5000000UL
/* 100 mm between the end stops. */
#define LOWEST_COUNTS (-6500)
#define HIGHEST_COUNTS 6500

#define HOST_SILENCE_MS 20
#define NOMINAL_RATE_HZ 1000
#define MODEL "serial-rig"
#define SERIAL "0001"

#define ENCODER_A PD2
#define ENCODER_B PD3
#define HOME_SWITCH PD4
#define BUTTON PD5
#define TTL_INPUT PD6
#define SYNC_OUTPUT PD7
#define MOTOR_PWM PB1
#define MOTOR_DIRECTION PB2

#endif
