/* The Teensy core library's raw HID calls, declared for a check without that library. */
#ifndef USB_RAWHID_H
#define USB_RAWHID_H

#include <stdint.h>

int usb_rawhid_available(void);
int usb_rawhid_recv(void *buffer, uint32_t timeout);
int usb_rawhid_send(const void *buffer, uint32_t timeout);

#endif
