/* What hid-rig uses of the Teensy core library's registers, for a check without that library. Whoever writes to WSR or
 * looks at SRSR gets the next of several cells, so that each write is seen. */
#ifndef IMXRT_H
#define IMXRT_H

#include <stdint.h>

extern volatile uint32_t CCM_CCGR3;
extern volatile uint16_t WDOG1_WCR, WDOG1_WMCR;
volatile uint16_t *next_wsr(void);
volatile uint32_t *srsr(void);

#define WDOG1_WSR (*next_wsr())
#define SRC_SRSR (*srsr())

#define CCM_CCGR_ON 3
#define CCM_CCGR3_WDOG1(n) ((uint32_t)(((n) & 0x03) << 16))
#define WDOG_WCR_WDE ((uint16_t)(1 << 2))
#define WDOG_WCR_SRS ((uint16_t)(1 << 4))
#define WDOG_WCR_WDA ((uint16_t)(1 << 5))
#define WDOG_WCR_WT(n) ((uint16_t)(((n) & 0xFF) << 8))
#define SRC_SRSR_WDOG_RST_B ((uint32_t)(1 << 4))

#endif
