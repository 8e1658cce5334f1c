#define _GNU_SOURCE
#include "usb.h"

#include <errno.h>
#include <linux/usbdevice_fs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

enum { QUEUE = 64, URBS = 8, IN = 0x81, OUT = 0x02, SETUP = 8 };
enum { GET_DESCRIPTOR = 6, STRING = 3, HID_REPORT = 0x22 };

/* In a struct usbdevfs_urb of the client. */
enum {
    URB_TYPE = offsetof(struct usbdevfs_urb, type),
    URB_ENDPOINT = offsetof(struct usbdevfs_urb, endpoint),
    URB_STATUS = offsetof(struct usbdevfs_urb, status),
    URB_BUFFER = offsetof(struct usbdevfs_urb, buffer),
    URB_LENGTH = offsetof(struct usbdevfs_urb, buffer_length),
    URB_ACTUAL = offsetof(struct usbdevfs_urb, actual_length),
};

struct urbs {
    UMockdevIoctlData *urb[URBS];
    size_t count;
};

struct reports {
    uint8_t bytes[QUEUE][REPORT];
    size_t length[QUEUE];
    size_t first, count;
};

struct usb {
    UMockdevIoctlBase *handler;
    GMutex lock; /* umockdev asks on its own thread */
    bool here, claimed;
    char serial[40];
    struct urbs waiting, finished;
    struct reports in, out;
};

static void put(struct reports *queue, const uint8_t *report, size_t length)
{
    if (queue->count < QUEUE) {
        size_t last = (queue->first + queue->count++) % QUEUE;
        queue->length[last] = length < REPORT ? length : REPORT;
        memcpy(queue->bytes[last], report, queue->length[last]);
    }
}

static size_t take(struct reports *queue, uint8_t *report)
{
    size_t first = queue->first;
    memcpy(report, queue->bytes[first], queue->length[first]);
    queue->first = (first + 1) % QUEUE;
    queue->count--;
    return queue->length[first];
}

static UMockdevIoctlData *take_urb(struct urbs *urbs, size_t at)
{
    UMockdevIoctlData *urb = urbs->urb[at];
    memmove(&urbs->urb[at], &urbs->urb[at + 1], (--urbs->count - at) * sizeof urb);
    return urb;
}

static void finish(struct usb *usb, UMockdevIoctlData *urb, int32_t status, int32_t length)
{
    umockdev_ioctl_data_update(urb, URB_STATUS, (uint8_t *)&status, sizeof status);
    umockdev_ioctl_data_update(urb, URB_ACTUAL, (uint8_t *)&length, sizeof length);
    usb->finished.urb[usb->finished.count++] = urb;
}

static UMockdevIoctlData *buffer_of(UMockdevIoctlData *urb)
{
    int32_t length;
    memcpy(&length, urb->data + URB_LENGTH, sizeof length);
    return umockdev_ioctl_data_resolve(urb, URB_BUFFER, (size_t)length, NULL);
}

static void answer_control(struct usb *usb, UMockdevIoctlData *urb)
{
    UMockdevIoctlData *buffer = buffer_of(urb);
    const uint8_t *setup = buffer->data;
    uint8_t answer[128];
    size_t length = 0, most = setup[6] | (size_t)setup[7] << 8;
    const char *strings[] = {NULL, "hapticd", "host-rig", usb->serial};
    int32_t status = 0;
    if (setup[1] == GET_DESCRIPTOR && setup[3] == HID_REPORT) {
        length = sizeof REPORT_DESCRIPTOR;
        memcpy(answer, REPORT_DESCRIPTOR, length);
    } else if (setup[1] == GET_DESCRIPTOR && setup[3] == STRING && setup[2] == 0) {
        length = 4;
        memcpy(answer, (uint8_t[]){4, STRING, 0x09, 0x04}, length);
    } else if (setup[1] == GET_DESCRIPTOR && setup[3] == STRING && setup[2] < 4) {
        const char *text = strings[setup[2]];
        for (length = 2; *text != '\0'; text++) {
            answer[length++] = (uint8_t)*text;
            answer[length++] = 0;
        }
        answer[0] = (uint8_t)length;
        answer[1] = STRING;
    } else {
        status = -EPIPE;
    }
    length = length < most ? length : most;
    umockdev_ioctl_data_update(buffer, SETUP, answer, (int)length);
    finish(usb, urb, status, (int32_t)length);
    g_object_unref(buffer);
}

static void submit(struct usb *usb, UMockdevIoctlData *urb)
{
    if (urb->data[URB_TYPE] == USBDEVFS_URB_TYPE_CONTROL) {
        answer_control(usb, urb);
    } else if (urb->data[URB_ENDPOINT] == IN) {
        usb->waiting.urb[usb->waiting.count++] = urb;
    } else {
        UMockdevIoctlData *buffer = buffer_of(urb);
        put(&usb->out, buffer->data, (size_t)buffer->data_len);
        finish(usb, urb, 0, buffer->data_len);
        g_object_unref(buffer);
    }
}

static void give_what_has_come(struct usb *usb)
{
    while (usb->waiting.count > 0 && usb->in.count > 0) {
        uint8_t report[REPORT];
        size_t length = take(&usb->in, report);
        UMockdevIoctlData *urb = take_urb(&usb->waiting, 0);
        UMockdevIoctlData *buffer = buffer_of(urb);
        umockdev_ioctl_data_update(buffer, 0, report, (int)length);
        g_object_unref(buffer);
        finish(usb, urb, 0, (int32_t)length);
    }
}

/* The error number of an ioctl, 0 when it succeeds; -1 when it is none of ours. */
static int carry_out(struct usb *usb, uint32_t request, UMockdevIoctlData *argument)
{
    uint32_t capabilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM;
    UMockdevIoctlData *data;
    switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
        data = umockdev_ioctl_data_resolve(argument, 0, sizeof capabilities, NULL);
        umockdev_ioctl_data_update(data, 0, (uint8_t *)&capabilities, sizeof capabilities);
        g_object_unref(data);
        return 0;
    case USBDEVFS_GETDRIVER:
        return ENODATA;
    case USBDEVFS_CLAIMINTERFACE:
        usb->claimed = true;
        usb->in.count = usb->out.count = 0;
        return usb->here ? 0 : ENODEV;
    case USBDEVFS_RELEASEINTERFACE:
        usb->claimed = false;
        return 0;
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE:
    case USBDEVFS_IOCTL:
        return 0;
    case USBDEVFS_SUBMITURB:
        if (!usb->here) {
            return ENODEV;
        }
        submit(usb, umockdev_ioctl_data_resolve(argument, 0, sizeof(struct usbdevfs_urb), NULL));
        return 0;
    case USBDEVFS_REAPURBNDELAY:
        give_what_has_come(usb);
        if (usb->finished.count == 0) {
            return usb->here ? EAGAIN : ENODEV;
        }
        UMockdevIoctlData *urb = take_urb(&usb->finished, 0);
        data = umockdev_ioctl_data_resolve(argument, 0, sizeof(void *), NULL);
        umockdev_ioctl_data_set_ptr(data, 0, urb);
        g_object_unref(data);
        g_object_unref(urb);
        return 0;
    case USBDEVFS_DISCARDURB:
        for (size_t at = 0; at < usb->waiting.count; at++) {
            if (usb->waiting.urb[at]->client_addr == *(gulong *)argument->data) {
                finish(usb, take_urb(&usb->waiting, at), -ENOENT, 0);
                return 0;
            }
        }
        return EINVAL;
    default:
        return -1;
    }
}

static gboolean on_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer context)
{
    (void)handler;
    struct usb *usb = context;
    gulong request = 0;
    UMockdevIoctlData *argument = NULL;
    g_object_get(client, "request", &request, "arg", &argument, NULL);
    g_mutex_lock(&usb->lock);
    int error = carry_out(usb, (uint32_t)request, argument);
    g_mutex_unlock(&usb->lock);
    g_object_unref(argument);
    if (error < 0) {
        return FALSE;
    }
    umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
    return TRUE;
}

struct usb *usb_new(void)
{
    struct usb *usb = calloc(1, sizeof *usb);
    g_mutex_init(&usb->lock);
    usb->handler = umockdev_ioctl_base_new();
    g_signal_connect(usb->handler, "handle-ioctl", G_CALLBACK(on_ioctl), usb);
    return usb;
}

void usb_free(struct usb *usb)
{
    g_object_unref(usb->handler);
    g_mutex_clear(&usb->lock);
    free(usb);
}

UMockdevIoctlBase *usb_handler(struct usb *usb)
{
    return usb->handler;
}

void usb_plug(struct usb *usb, const char *serial, char *attributes, size_t size)
{
    g_mutex_lock(&usb->lock);
    usb->here = true;
    usb->claimed = false;
    snprintf(usb->serial, sizeof usb->serial, "%s", serial);
    g_mutex_unlock(&usb->lock);
    snprintf(attributes, size,
             "A: idVendor=%04x\\n\nA: idProduct=%04x\\n\nA: speed=12\\n\nA: bConfigurationValue=1\\n\n"
             "A: manufacturer=hapticd\\n\nA: product=host-rig\\n\nA: serial=%s\\n\n"
             "H: descriptors="
             "1201000200000040C0168604000101020301" /* device */
             "090229000101000032"                   /* configuration, 41 bytes in all */
             "090400000203000000"                   /* interface 0, HID, two endpoints */
             "09211101000122%02X00"                 /* HID, with a report descriptor so long */
             "07058103400001"                       /* 64 bytes in, each 1 ms */
             "07050203400001\n",                    /* 64 bytes out */
             VENDOR, PRODUCT, serial, (unsigned)sizeof REPORT_DESCRIPTOR);
}

void usb_unplug(struct usb *usb)
{
    g_mutex_lock(&usb->lock);
    usb->here = usb->claimed = false;
    g_mutex_unlock(&usb->lock);
}

bool usb_claimed(struct usb *usb)
{
    g_mutex_lock(&usb->lock);
    bool claimed = usb->claimed;
    g_mutex_unlock(&usb->lock);
    return claimed;
}

bool usb_receive(struct usb *usb, uint8_t report[REPORT])
{
    g_mutex_lock(&usb->lock);
    bool any = usb->out.count > 0;
    if (any) {
        take(&usb->out, report);
    }
    g_mutex_unlock(&usb->lock);
    return any;
}

void usb_send(struct usb *usb, const uint8_t *report, size_t length)
{
    g_mutex_lock(&usb->lock);
    put(&usb->in, report, length);
    g_mutex_unlock(&usb->lock);
}
