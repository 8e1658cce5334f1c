/* What the device says: each builds one message from the state of the rig and sends it. */
#ifndef RIG_SPEECH_H
#define RIG_SPEECH_H

#include "rig.h"

void say_identity(struct rig *rig);
void say_axis(struct rig *rig, uint8_t axis);
void say_state(struct rig *rig);
void say_pong(struct rig *rig, uint32_t token, uint32_t received_us);
void say_fault(struct rig *rig, const struct rig_problem *problem);
void say_refused(struct rig *rig, enum rig_refusal reason, uint8_t type);

#endif
