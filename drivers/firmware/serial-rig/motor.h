/* H-bridge with PWM and direction: a current, and so a force, in proportion. */
#ifndef MOTOR_H
#define MOTOR_H

#include <stdint.h>

void motor_start(void);

/* Force at the handle [uN], at most MAX_FORCE_UN either way. */
void motor_drive(int32_t force_un);

#endif
