/* An FTDI adapter of umockdev with nothing behind it: a process that runs with its preload library finds a USB serial
 * port, and may ask it for low latency.
 *
 * Prints the testbed's directory; for each line on standard input the adapter's flags in hexadecimal. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <umockdev.h>

enum { TIOCGSERIAL = 0x541e, TIOCSSERIAL = 0x541f, SERIAL_STRUCT = 72, FLAGS_AT = 16, LOW_LATENCY = 0x2000 };

static const char ADAPTER[] =
    "P: /devices/usb1/1-1\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nA: idVendor=0403\\n\nA: idProduct=6001\\n\n"
    "A: bNumInterfaces=1\\n\nA: manufacturer=FTDI\\n\nA: product=FT232R USB UART\\n\nA: serial=A50285BI\\n\n\n"
    "P: /devices/usb1/1-1/1-1:1.0\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\nA: bInterfaceNumber=00\\n\n\n"
    "P: /devices/usb1/1-1/1-1:1.0/ttyUSB0\nE: SUBSYSTEM=usb-serial\nA: latency_timer=16\\n\n\n"
    "P: /devices/usb1/1-1/1-1:1.0/ttyUSB0/tty/ttyUSB0\nN: ttyUSB0\nE: SUBSYSTEM=tty\nE: DEVNAME=/dev/ttyUSB0\n"
    "A: dev=188:0\\n\nL: device=../../../ttyUSB0\n\n";
static const char PORT[] = "/sys/devices/usb1/1-1/1-1:1.0/ttyUSB0";

static uint8_t settings[SERIAL_STRUCT];

static uint32_t flags(void)
{
    uint32_t value;
    memcpy(&value, settings + FLAGS_AT, sizeof value);
    return value;
}

/* On umockdev's own thread. */
static gboolean on_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer testbed)
{
    (void)handler;
    gulong request = 0;
    UMockdevIoctlData *argument = NULL;
    g_object_get(client, "request", &request, "arg", &argument, NULL);
    request &= 0xffffffff;
    gboolean known = request == TIOCGSERIAL || request == TIOCSSERIAL;
    if (known) {
        UMockdevIoctlData *data = umockdev_ioctl_data_resolve(argument, 0, SERIAL_STRUCT, NULL);
        if (request == TIOCGSERIAL) {
            umockdev_ioctl_data_update(data, 0, settings, SERIAL_STRUCT);
        } else {
            guint8 *given = NULL;
            gint length = 0;
            umockdev_ioctl_data_retrieve(data, &given, &length);
            memcpy(settings, given, SERIAL_STRUCT);
            g_free(given);
            /* As ftdi_sio does. */
            umockdev_testbed_set_attribute(testbed, PORT, "latency_timer", flags() & LOW_LATENCY ? "1\n" : "16\n");
        }
        g_object_unref(data);
        umockdev_ioctl_client_complete(client, 0, 0);
    }
    g_object_unref(argument);
    return known;
}

int main(void)
{
    GError *error = NULL;
    UMockdevTestbed *testbed = umockdev_testbed_new();
    UMockdevIoctlBase *handler = umockdev_ioctl_base_new();
    g_signal_connect(handler, "handle-ioctl", G_CALLBACK(on_ioctl), testbed);
    if (!umockdev_testbed_add_from_string(testbed, ADAPTER, &error) ||
        !umockdev_testbed_attach_ioctl(testbed, "/dev/ttyUSB0", handler, &error)) {
        fprintf(stderr, "serial_double: %s\n", error->message);
        return 1;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    char *directory = umockdev_testbed_get_root_dir(testbed);
    puts(directory);
    char line[16];
    while (fgets(line, sizeof line, stdin) != NULL) {
        printf("%x\n", flags());
    }
    umockdev_testbed_detach_ioctl(testbed, "/dev/ttyUSB0", NULL);
    g_free(directory);
    g_object_unref(handler);
    g_object_unref(testbed);
    return 0;
}
