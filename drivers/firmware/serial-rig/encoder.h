/* Quadrature encoder on the two external interrupts: four counts a line. */
#ifndef ENCODER_H
#define ENCODER_H

#include <stdbool.h>
#include <stdint.h>

/* After clock_start(). */
void encoder_start(void);
int32_t encoder_counts(void);

/* Whether both channels have changed at once since the last encoder_forget(): counts may be missing. */
bool encoder_slipped(void);
void encoder_forget(void);

#endif
