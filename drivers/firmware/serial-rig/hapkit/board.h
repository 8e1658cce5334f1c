/* Hapkit: what is fastened to which pin, and its mechanics. Measure yours, and change it here.
 *
 *   PD0 RX, PD1 TX      serial line to the host
 *   PC2 (A2)            angle of the magnet on the motor's shaft: 0 to 5 V, twice a turn
 *   PD5 (D5)            PWM, 62.5 kHz: share of the supply that the motor gets
 *   PB0 (D8)            direction: high pushes towards growing counts
 *   PD2 (D2)            push button to ground
 *   PD3 (D3)            TTL input, 5 V; high when nothing is connected
 *   PD4 (D4)            sync output, 5 V: turns when a position is taken for a tick
 *
 * D6 and D7 are the second motor's and stay untouched. Put a pull-down resistor on PD5 where the board has none: the pin
 * floats while the processor is in reset, and the motor must be off then. */
#ifndef BOARD_H
#define BOARD_H

#define BAUD 1000000UL

/* Radius of the pulley on the motor's shaft, of the sector that it drives, and of the handle about the same pivot. */
#define PULLEY_M 5.0e-3
#define SECTOR_M 74.0e-3
#define HANDLE_M 70.0e-3
#define SHAFT_RAD_PER_M (SECTOR_M / (HANDLE_M * PULLEY_M))

/* The sensor: readings of the converter at the two ends of a half turn, and the angle in counts at the readings 0, 64, 128
 * to 1024. As it stands a straight line; docs/hapkit.md says when yours needs other numbers. */
#define LOWEST_RAW 15
#define HIGHEST_RAW 980
#define LINE(raw) ((int16_t)(((raw) - LOWEST_RAW) * 1024L / (HIGHEST_RAW - LOWEST_RAW)))
#define TABLE {LINE(0), LINE(64), LINE(128), LINE(192), LINE(256), LINE(320), LINE(384), LINE(448), LINE(512), \
               LINE(576), LINE(640), LINE(704), LINE(768), LINE(832), LINE(896), LINE(960), LINE(1024)}
/* A reading outside of these is a broken wire. */
#define ALIVE_FROM_RAW 5
#define ALIVE_TO_RAW 1015

#define HALF_TURN_COUNTS 1024
#define COUNT_PM ((uint32_t)(3.14159265 / SHAFT_RAD_PER_M / HALF_TURN_COUNTS * 1e12))

/* The motor: its torque grows with the square of the duty, to this at 100 % [N m]. */
#define FULL_TORQUE_NM 14.6e-3
#define MAX_FORCE_UN ((uint32_t)(FULL_TORQUE_NM * SHAFT_RAD_PER_M * 1e6))

/* 70 mm between the end stops. */
#define LOWEST_COUNTS (-2413)
#define HIGHEST_COUNTS 2413

#define HOST_SILENCE_MS 20
#define NOMINAL_RATE_HZ 1000
#define MODEL "hapkit"
#define SERIAL "0001"

#define SENSOR_CHANNEL 2 /* of port C */
#define BUTTON PD2
#define TTL_INPUT PD3
#define SYNC_OUTPUT PD4
#define MOTOR_PWM PD5
#define MOTOR_DIRECTION PB0

#endif
