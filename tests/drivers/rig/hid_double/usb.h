/* The same rig as a USB device, for who goes past the kernel's HID driver: usbfs, as libusb uses it. */
#ifndef USB_H
#define USB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <umockdev.h>

#include "report_descriptor.h"

struct usb;

struct usb *usb_new(void);
void usb_free(struct usb *usb);

UMockdevIoctlBase *usb_handler(struct usb *usb);

/* Attributes of the device for umockdev's description, with its string descriptors from now on. */
void usb_plug(struct usb *usb, const char *serial, char *attributes, size_t size);
void usb_unplug(struct usb *usb);

/* Somebody has claimed the interface: reports are theirs. */
bool usb_claimed(struct usb *usb);

bool usb_receive(struct usb *usb, uint8_t report[REPORT]);
void usb_send(struct usb *usb, const uint8_t *report, size_t length);

#endif
