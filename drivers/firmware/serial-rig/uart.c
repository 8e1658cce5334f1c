#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "board.h"

/* One writer and one reader each; an index of one byte is read and written in one go, so nothing is locked. */
enum { RING = 128, MASK = RING - 1 };

struct ring {
    volatile uint8_t head; /* next to write */
    volatile uint8_t tail; /* next to read */
    volatile uint8_t bytes[RING];
};

static struct ring received, sending;

ISR(USART_RX_vect)
{
    uint8_t byte = UDR0;
    uint8_t next = (received.head + 1) & MASK;
    if (next != received.tail) { /* a byte that is lost makes a wrong CRC */
        received.bytes[received.head] = byte;
        received.head = next;
    }
}

ISR(USART_UDRE_vect)
{
    UDR0 = sending.bytes[sending.tail];
    sending.tail = (sending.tail + 1) & MASK;
    if (sending.tail == sending.head) {
        UCSR0B &= (uint8_t)~(1 << UDRIE0);
    }
}

void uart_start(void)
{
    UCSR0A = 1 << U2X0;
    UBRR0 = F_CPU / 8 / BAUD - 1;
    _Static_assert(F_CPU / 8 % BAUD == 0, "this baud rate is not exact at this clock");
    UCSR0C = 1 << UCSZ01 | 1 << UCSZ00; /* 8N1 */
    UCSR0B = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
}

int16_t uart_read(void)
{
    if (received.tail == received.head) {
        return -1;
    }
    uint8_t byte = received.bytes[received.tail];
    received.tail = (received.tail + 1) & MASK;
    return byte;
}

bool uart_write(const uint8_t *bytes, uint8_t length)
{
    uint8_t room = (sending.tail - sending.head - 1) & MASK;
    if (length > room) {
        return false;
    }
    uint8_t head = sending.head;
    for (uint8_t i = 0; i < length; i++) {
        sending.bytes[head] = bytes[i];
        head = (head + 1) & MASK;
    }
    sending.head = head;
    UCSR0B |= 1 << UDRIE0;
    return true;
}
