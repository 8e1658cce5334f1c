#define _GNU_SOURCE
#include "bed.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/hidraw.h>
#include <linux/input.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <umockdev.h>
#include <unistd.h>

#include "usb.h"

enum { QUEUE = 64 };

struct report {
    size_t length;
    uint8_t bytes[REPORT];
};

struct bed {
    UMockdevTestbed *testbed;
    UMockdevIoctlBase *handler;
    char *directory;
    struct usb *usb;
    int times_plugged; /* each time into another port, and as another hidraw */
    char hid[120], node[40], raw[160];
    int device, client; /* both ends of the pseudo-terminal; the client's is only looked at, and stopped */
    bool held;
    bool odd; /* a report of another length than 64 is on the line */
    struct report queue[QUEUE];
    size_t first, count;
    uint8_t begun[OUTPUT_REPORT];
    size_t begun_length;
};

static void check(bool fine, const char *what, GError *error)
{
    if (!fine) {
        fprintf(stderr, "hid_double: %s: %s\n", what, error != NULL ? error->message : strerror(errno));
        exit(1);
    }
}

static void answer(UMockdevIoctlData *argument, size_t offset, const void *bytes, size_t length)
{
    UMockdevIoctlData *data = umockdev_ioctl_data_resolve(argument, 0, offset + length, NULL);
    umockdev_ioctl_data_update(data, offset, (uint8_t *)bytes, (int)length);
    g_object_unref(data);
}

static gboolean on_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer unused)
{
    (void)handler;
    (void)unused;
    gulong request = 0;
    UMockdevIoctlData *argument = NULL;
    g_object_get(client, "request", &request, "arg", &argument, NULL);
    uint32_t size = sizeof REPORT_DESCRIPTOR;
    struct hidraw_devinfo info = {BUS_USB, VENDOR, PRODUCT};
    switch ((uint32_t)request) {
    case HIDIOCGRDESCSIZE:
        answer(argument, 0, &size, sizeof size);
        break;
    case HIDIOCGRDESC:
        answer(argument, offsetof(struct hidraw_report_descriptor, value), REPORT_DESCRIPTOR, sizeof REPORT_DESCRIPTOR);
        break;
    case HIDIOCGRAWINFO:
        answer(argument, 0, &info, sizeof info);
        break;
    default:
        g_object_unref(argument);
        return FALSE;
    }
    g_object_unref(argument);
    umockdev_ioctl_client_complete(client, 0, 0);
    return TRUE;
}

/* On umockdev's own thread. */
static void on_open(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer bed)
{
    (void)handler;
    (void)client;
    tcflush(((struct bed *)bed)->client, TCIFLUSH);
}

struct bed *bed_new(void)
{
    setsid();
    signal(SIGHUP, SIG_IGN);
    struct bed *bed = calloc(1, sizeof *bed);
    check(bed != NULL, "memory", NULL);
    bed->testbed = umockdev_testbed_new();
    bed->directory = umockdev_testbed_get_root_dir(bed->testbed);
    bed->handler = umockdev_ioctl_base_new();
    bed->usb = usb_new();
    g_signal_connect(bed->handler, "handle-ioctl", G_CALLBACK(on_ioctl), NULL);
    g_signal_connect(bed->handler, "client-connected", G_CALLBACK(on_open), bed);
    bed->device = bed->client = -1;
    return bed;
}

void bed_free(struct bed *bed)
{
    if (bed->device >= 0) {
        bed_unplug(bed);
    }
    for (int number = 0; number < bed->times_plugged; number++) {
        /* Not when it is unplugged: umockdev ends a client that is just asking for something. */
        char node[40];
        snprintf(node, sizeof node, "/dev/hidraw%d", number);
        umockdev_testbed_detach_ioctl(bed->testbed, node, NULL);
        snprintf(node, sizeof node, "/dev/bus/usb/001/%03d", number + 1);
        umockdev_testbed_detach_ioctl(bed->testbed, node, NULL);
    }
    g_object_unref(bed->handler);
    g_object_unref(bed->testbed);
    usb_free(bed->usb);
    g_free(bed->directory);
    free(bed);
}

const char *bed_directory(const struct bed *bed)
{
    return bed->directory;
}

int bed_descriptor(const struct bed *bed)
{
    return bed->held ? -1 : bed->device;
}

void bed_plug(struct bed *bed, const char *serial)
{
    char text[2000], attributes[700], usb_node[40];
    GError *error = NULL;
    int number = bed->times_plugged++;
    char port[40];
    snprintf(port, sizeof port, "/devices/usb1/1-%d", number + 1);
    snprintf(bed->hid, sizeof bed->hid, "%s/1-%d:1.0/0003:16C0:0486.%04X", port, number + 1, number + 1);
    snprintf(bed->node, sizeof bed->node, "/dev/hidraw%d", number);
    snprintf(bed->raw, sizeof bed->raw, "%s/hidraw/hidraw%d", bed->hid, number);
    snprintf(usb_node, sizeof usb_node, "/dev/bus/usb/001/%03d", number + 1);
    usb_plug(bed->usb, serial, attributes, sizeof attributes);
    snprintf(text, sizeof text,
             "P: %s\nN: bus/usb/001/%03d=00\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DEVNAME=%s\n"
             "E: BUSNUM=001\nE: DEVNUM=%03d\nA: busnum=1\\n\nA: devnum=%d\\n\n%s\n"
             "P: %s/1-%d:1.0\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\nA: bInterfaceNumber=00\\n\n\n"
             "P: %s\nE: SUBSYSTEM=hid\nE: DRIVER=hid-generic\nE: HID_ID=0003:000016C0:00000486\n"
             "E: HID_NAME=host-rig\nE: HID_UNIQ=%s\nE: HID_PHYS=usb-0000:00:14.0-1/input0\n"
             "H: report_descriptor=",
             port, number + 1, usb_node, number + 1, number + 1, attributes, port, number + 1, bed->hid, serial);
    for (size_t i = 0; i < sizeof REPORT_DESCRIPTOR; i++) {
        snprintf(text + strlen(text), sizeof text - strlen(text), "%02X", REPORT_DESCRIPTOR[i]);
    }
    snprintf(text + strlen(text), sizeof text - strlen(text),
             "\n\nP: %s\nN: %s\nE: SUBSYSTEM=hidraw\nE: DEVNAME=%s\nE: MAJOR=240\nE: MINOR=%d\nA: dev=240:%d\\n\n"
             "L: device=../../../0003:16C0:0486.%04X\n\n",
             bed->raw, bed->node + strlen("/dev/"), bed->node, number, number, number + 1);
    check(umockdev_testbed_add_from_string(bed->testbed, text, &error), "plug", error);
    bed->device = umockdev_testbed_get_dev_fd(bed->testbed, bed->node);
    bed->client = open(ptsname(bed->device), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    check(bed->client >= 0, "open", NULL);
    /* Else it would be that of the first session leader to open it, whom the end of a terminal kills. */
    check(ioctl(bed->client, TIOCSCTTY, 0) == 0, "controlling terminal", NULL);
    check(fcntl(bed->device, F_SETFL, O_NONBLOCK) == 0, "fcntl", NULL);
    struct termios raw;
    check(tcgetattr(bed->client, &raw) == 0, "tcgetattr", NULL);
    cfmakeraw(&raw);
    check(tcsetattr(bed->client, TCSANOW, &raw) == 0, "tcsetattr", NULL);
    check(umockdev_testbed_attach_ioctl(bed->testbed, bed->node, bed->handler, &error), "attach", error);
    check(umockdev_testbed_attach_ioctl(bed->testbed, usb_node, usb_handler(bed->usb), &error), "attach", error);
    bed->held = bed->odd = false;
    bed->count = bed->begun_length = 0;
}

void bed_unplug(struct bed *bed)
{
    char path[200];
    snprintf(path, sizeof path, "/sys%s", bed->raw);
    umockdev_testbed_remove_device(bed->testbed, path);
    snprintf(path, sizeof path, "/sys%s", bed->hid);
    umockdev_testbed_remove_device(bed->testbed, path);
    snprintf(path, sizeof path, "/sys/devices/usb1/1-%d", bed->times_plugged);
    umockdev_testbed_remove_device(bed->testbed, path);
    usb_unplug(bed->usb);
    /* A kernel has this whether a device is there or not. */
    snprintf(path, sizeof path, "%s/sys/class/hidraw", bed->directory);
    g_mkdir_with_parents(path, 0755);
    /* umockdev forgets this, and cannot use the number of the terminal again */
    snprintf(path, sizeof path, "%s/dev/.ptymap/_dev_pts_%s", bed->directory, strrchr(ptsname(bed->device), '/') + 1);
    unlink(path);
    close(bed->client);
    close(bed->device); /* hangs up on whoever has the node open */
    bed->device = bed->client = -1;
    bed->held = false;
}

bool bed_receive(struct bed *bed, uint8_t report[OUTPUT_REPORT])
{
    if (usb_claimed(bed->usb)) {
        report[0] = 0;
        return usb_receive(bed->usb, report + 1);
    }
    if (bed->held || bed->device < 0) {
        return false;
    }
    while (bed->begun_length < OUTPUT_REPORT) {
        ssize_t length = read(bed->device, bed->begun + bed->begun_length, OUTPUT_REPORT - bed->begun_length);
        if (length <= 0) {
            return false;
        }
        bed->begun_length += (size_t)length;
    }
    bed->begun_length = 0;
    memcpy(report, bed->begun, OUTPUT_REPORT);
    return true;
}

void bed_send(struct bed *bed, const uint8_t *report, size_t length)
{
    if (usb_claimed(bed->usb)) {
        usb_send(bed->usb, report, length);
        return;
    }
    if (bed->device < 0 || bed->count == QUEUE) {
        return;
    }
    struct report *last = &bed->queue[(bed->first + bed->count++) % QUEUE];
    last->length = length < REPORT ? length : REPORT;
    memcpy(last->bytes, report, last->length);
}

/* Bytes that the clients have not read yet. */
static int unread(const struct bed *bed)
{
    int waiting = 0;
    struct pollfd client = {.fd = bed->client, .events = POLLIN};
    poll(&client, 1, 0); /* has the kernel bring over what is still on its way */
    ioctl(bed->client, FIONREAD, &waiting);
    return waiting;
}

void bed_work(struct bed *bed)
{
    while (bed->device >= 0 && bed->count > 0) {
        const struct report *next = &bed->queue[bed->first];
        int waiting = unread(bed);
        bool is_odd = next->length != REPORT;
        if (waiting > 0 && (is_odd || bed->odd)) {
            return; /* a terminal would run the two together */
        }
        bed->first = (bed->first + 1) % QUEUE;
        bed->count--;
        if (waiting < (QUEUE - 1) * REPORT && write(bed->device, next->bytes, next->length) > 0) {
            bed->odd = is_odd;
        }
    }
}

void bed_hold(struct bed *bed)
{
    bed->held = true;
    check(tcflow(bed->client, TCOOFF) == 0, "hold", NULL); /* a terminal that is stopped takes nothing */
}

void bed_release(struct bed *bed)
{
    bed->held = false;
    check(tcflow(bed->client, TCOON) == 0, "release", NULL);
}
