#include "processor.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

enum {
    CYCLES_PER_US = 16,
    SLICE = 16, /* cycles between two looks at the pins */
    BYTE = 160, /* cycles of a byte at 1 Mbaud */
    SAID = 4096,
};

/* Data addresses of what drives the motor (ATmega328P data sheet, register summary). */
enum { DDRB = 0x24, PORTB = 0x25, DDRD = 0x2a, PORTD = 0x2b, TCCR1A = 0x80, TCCR1B = 0x81, ICR1L = 0x86, OCR1AL = 0x88 };
enum { PIN_PWM = 1, PIN_DIRECTION = 2 };                /* of port B */
enum { PIN_A = 2, PIN_B = 3, PIN_HOME_SWITCH = 4, PIN_BUTTON = 5, PIN_TTL = 6, PIN_SYNC = 7 }; /* of port D */
enum { OUTSIDE = 1 << PIN_A | 1 << PIN_B | 1 << PIN_HOME_SWITCH | 1 << PIN_BUTTON | 1 << PIN_TTL };

static const double FULL_FORCE_N = 5.0; /* at a duty of 1, as drivers/firmware/serial-rig/board.h has it */

struct processor {
    avr_t *avr; /* NULL while it is switched off */
    elf_firmware_t firmware;
    struct handle *handle;
    avr_irq_t *port_d[8], *uart_in;
    unsigned levels; /* that the pins of port D show */
    bool fifo_is_full;
    avr_cycle_count_t next_byte;
    uint8_t said[SAID];
    unsigned said_first, said_count;
    unsigned resets;
    unsigned syncs;
    bool sync_level;
};

static struct processor the_processor; /* simavr's reset hook has no argument of ours */

static unsigned data16(const struct processor *processor, unsigned low)
{
    return processor->avr->data[low] | (unsigned)processor->avr->data[low + 1] << 8;
}

/* What the bridge makes of its two pins: nothing at all unless the timer really drives them. */
static double motor_force_n(const struct processor *processor)
{
    const uint8_t *data = processor->avr->data;
    unsigned both = 1 << PIN_PWM | 1 << PIN_DIRECTION;
    unsigned top = data16(processor, ICR1L);
    bool phase_correct = (data[TCCR1A] & 0x83) == 0x82 && (data[TCCR1B] & 0x1f) == 0x11;
    if (!phase_correct || (data[DDRB] & both) != both || top == 0) {
        return 0.0;
    }
    double duty = fmin(1.0, (double)data16(processor, OCR1AL) / top);
    bool forwards = data[PORTB] >> PIN_DIRECTION & 1;
    return (forwards == processor->handle->reversed ? -duty : duty) * FULL_FORCE_N;
}

static void show_pins(struct processor *processor)
{
    unsigned channels = handle_channels(processor->handle);
    bool at_lower_stop = handle_counts(processor->handle) <= -STOP_COUNTS;
    unsigned levels = (channels & 1) << PIN_A | channels >> 1 << PIN_B | (unsigned)!at_lower_stop << PIN_HOME_SWITCH |
                      (unsigned)!processor->handle->button << PIN_BUTTON |
                      (unsigned)processor->handle->ttl << PIN_TTL;
    if (levels == processor->levels) {
        return;
    }
    processor->levels = levels;
    /* What drives a pin from outside wins over the pull-up that the firmware switches on. */
    avr_ioport_external_t outside = {.name = 'D', .mask = OUTSIDE, .value = levels};
    avr_ioctl(processor->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    for (unsigned pin = PIN_A; pin <= PIN_TTL; pin++) {
        avr_raise_irq(processor->port_d[pin], levels >> pin & 1);
    }
}

static void byte_out(struct avr_irq_t *irq, uint32_t value, void *self)
{
    struct processor *processor = self;
    (void)irq;
    if (processor->said_count < SAID) {
        processor->said[(processor->said_first + processor->said_count++) % SAID] = (uint8_t)value;
    }
}

static void fifo_has_room(struct avr_irq_t *irq, uint32_t value, void *self)
{
    (void)irq, (void)value;
    ((struct processor *)self)->fifo_is_full = false;
}

static void fifo_is_full(struct avr_irq_t *irq, uint32_t value, void *self)
{
    (void)irq, (void)value;
    ((struct processor *)self)->fifo_is_full = true;
}

static void errors_only(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level <= LOG_ERROR) {
        vfprintf(stderr, format, arguments);
    }
}

static void count_reset(avr_t *avr)
{
    (void)avr;
    the_processor.resets++;
}

struct processor *processor_new(const char *firmware, struct handle *handle)
{
    avr_global_logger_set(errors_only);
    if (elf_read_firmware(firmware, &the_processor.firmware) != 0) {
        fprintf(stderr, "%s is no firmware\n", firmware);
        exit(1);
    }
    the_processor.handle = handle;
    return &the_processor;
}

void processor_switch_on(struct processor *processor)
{
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    uint32_t flags = 0;
    avr_init(avr);
    avr_load_firmware(avr, &processor->firmware);
    avr->frequency = CYCLES_PER_US * 1000000;
    avr->log = LOG_ERROR;
    avr->reset = count_reset;
    processor->avr = avr;
    processor->next_byte = 0;
    processor->fifo_is_full = false;
    processor->said_count = 0;
    processor->resets = 0;
    processor->syncs = 0;
    processor->sync_level = false;

    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_POLL_SLEEP | AVR_UART_FLAG_STDIO);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_t *uart = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), 0);
    processor->uart_in = uart + UART_IRQ_INPUT;
    avr_irq_register_notify(uart + UART_IRQ_OUTPUT, byte_out, processor);
    avr_irq_register_notify(uart + UART_IRQ_OUT_XON, fifo_has_room, processor);
    avr_irq_register_notify(uart + UART_IRQ_OUT_XOFF, fifo_is_full, processor);
    for (int pin = 0; pin < 8; pin++) {
        processor->port_d[pin] = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), pin);
    }
    processor->levels = ~0u; /* unlike any */
    show_pins(processor);
}

void processor_switch_off(struct processor *processor)
{
    avr_terminate(processor->avr);
    free(processor->avr);
    processor->avr = NULL;
    processor->handle->motor_n = 0.0;
}

bool processor_is_on(const struct processor *processor)
{
    return processor->avr != NULL;
}

/* An edge counts only where the firmware really drives the pin. */
static void look_at_sync(struct processor *processor)
{
    const uint8_t *data = processor->avr->data;
    bool level = data[DDRD] >> PIN_SYNC & 1 && data[PORTD] >> PIN_SYNC & 1;
    processor->syncs += level != processor->sync_level;
    processor->sync_level = level;
}

double processor_run(struct processor *processor)
{
    avr_t *avr = processor->avr;
    avr_cycle_count_t begin = avr->cycle;
    while (avr->cycle < begin + SLICE) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the firmware has crashed\n");
            exit(1);
        }
    }
    double us = (double)(avr->cycle - begin) / CYCLES_PER_US;
    processor->handle->motor_n = motor_force_n(processor);
    look_at_sync(processor);
    handle_move(processor->handle, us * 1e-6);
    show_pins(processor);
    return us;
}

bool processor_listens(const struct processor *processor)
{
    return !processor->fifo_is_full && processor->avr->cycle >= processor->next_byte;
}

void processor_hear(struct processor *processor, uint8_t byte)
{
    processor->next_byte = processor->avr->cycle + BYTE;
    avr_raise_irq(processor->uart_in, byte);
}

int processor_said(struct processor *processor)
{
    if (processor->said_count == 0) {
        return -1;
    }
    uint8_t byte = processor->said[processor->said_first];
    processor->said_first = (processor->said_first + 1) % SAID;
    processor->said_count--;
    return byte;
}

void processor_hang(struct processor *processor)
{
    avr_t *avr = processor->avr;
    avr_flashaddr_t behind = (processor->firmware.flashsize + 3) & ~1u; /* the firmware */
    avr->flash[behind] = 0xff;                                           /* rjmp .-2, a jump to itself */
    avr->flash[behind + 1] = 0xcf;
    avr->codeend = behind + 2;
    avr->sreg[S_I] = 0;
    avr->pc = behind;
}

unsigned processor_syncs(const struct processor *processor)
{
    return processor->syncs;
}

unsigned processor_resets(const struct processor *processor)
{
    return processor->resets;
}
