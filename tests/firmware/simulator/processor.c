#include "processor.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
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

struct processor {
    avr_t *avr; /* NULL while it is switched off */
    elf_firmware_t firmware;
    struct handle *handle;
    const struct wiring *wiring;
    avr_irq_t *port_d[8], *uart_in, *analog;
    unsigned levels; /* that the pins of port D show */
    uint32_t millivolts;
    bool fifo_is_full;
    avr_cycle_count_t next_byte;
    uint8_t said[SAID];
    unsigned said_first, said_count;
    unsigned resets;
    unsigned syncs;
    bool sync_level;
};

static struct processor the_processor; /* simavr's reset hook has no argument of ours */

static void show_pins(struct processor *processor, double dt_s)
{
    const struct wiring *wiring = processor->wiring;
    unsigned levels = wiring->levels(processor->handle);
    if (wiring->millivolts != NULL) {
        uint32_t now = (uint32_t)wiring->millivolts(processor->handle, processor->avr->data, dt_s);
        if (now != processor->millivolts) {
            processor->millivolts = now;
            avr_raise_irq(processor->analog, now);
        }
    }
    if (levels == processor->levels) {
        return;
    }
    processor->levels = levels;
    /* What drives a pin from outside wins over the pull-up that the firmware switches on. */
    avr_ioport_external_t outside = {.name = 'D', .mask = wiring->outside, .value = levels};
    avr_ioctl(processor->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    for (unsigned pin = 0; pin < 8; pin++) {
        if (wiring->outside >> pin & 1) {
            avr_raise_irq(processor->port_d[pin], levels >> pin & 1);
        }
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

struct processor *processor_new(const char *firmware, const struct wiring *wiring, struct handle *handle)
{
    avr_global_logger_set(errors_only);
    if (elf_read_firmware(firmware, &the_processor.firmware) != 0) {
        fprintf(stderr, "%s is no firmware\n", firmware);
        exit(1);
    }
    the_processor.wiring = wiring;
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
    avr->vcc = avr->avcc = avr->aref = 5000;
    avr->log = LOG_ERROR;
    avr->reset = count_reset;
    processor->avr = avr;
    processor->next_byte = 0;
    processor->fifo_is_full = false;
    processor->said_count = 0;
    processor->resets = 0;
    processor->syncs = 0;
    processor->sync_level = false;

    for (uint8_t external = 0; external < 2; external++) { /* else a pin that is low is looked at in every cycle */
        avr_extint_set_strict_lvl_trig(avr, external, 0);
    }

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
    processor->analog = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC2);
    processor->levels = ~0u; /* unlike any */
    processor->millivolts = ~0u;
    show_pins(processor, 0.0);
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
    uint8_t pin = processor->wiring->sync_pin;
    bool level = data[DDRD] >> pin & 1 && data[PORTD] >> pin & 1;
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
    double motor_n = processor->wiring->motor_n(avr->data);
    processor->handle->motor_n = processor->handle->reversed ? -motor_n : motor_n;
    look_at_sync(processor);
    handle_move(processor->handle, us * 1e-6);
    show_pins(processor, us * 1e-6);
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
