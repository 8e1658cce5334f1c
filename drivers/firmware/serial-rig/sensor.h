/* Where the handle is: what main.c asks of a board's sensor. */
#ifndef SENSOR_H
#define SENSOR_H

#include <stdbool.h>
#include <stdint.h>

/* After clock_start(). */
void sensor_start(void);
int32_t sensor_counts(void);

/* Whether counts may be missing since the last sensor_forget(); what is still wrong is not forgotten. */
bool sensor_slipped(void);
void sensor_forget(void);

#endif
