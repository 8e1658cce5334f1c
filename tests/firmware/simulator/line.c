#define _GNU_SOURCE
#include "line.h"

#include <fcntl.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

enum { ROOM = 65536 };

static struct {
    int master, slave;
    char link[4096];
    uint8_t in[ROOM], out[ROOM];
    size_t in_first, in_let, in_end, out_end; /* of what has come, behind in_let waits for its millisecond */
    unsigned long taken, given, frames;
} line = {.master = -1, .slave = -1};

void line_plug(const char *link)
{
    struct termios raw;
    memset(&line, 0, sizeof line);
    snprintf(line.link, sizeof line.link, "%s", link);
    if (openpty(&line.master, &line.slave, NULL, NULL, NULL) != 0) {
        perror("openpty");
        exit(1);
    }
    tcgetattr(line.slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(line.slave, TCSANOW, &raw); /* it stays open here, so that hosts may come and go */
    fcntl(line.master, F_SETFL, O_NONBLOCK);
    if (symlink(ttyname(line.slave), line.link) != 0) {
        perror(line.link);
        exit(1);
    }
}

void line_unplug(void)
{
    unlink(line.link);
    close(line.slave);
    close(line.master);
    line.master = line.slave = -1;
}

int line_descriptor(void)
{
    return line.master;
}

bool line_has_room(void)
{
    return line.in_end < ROOM;
}

void line_take(void)
{
    if (line.in_first == line.in_end) {
        line.in_first = line.in_let = line.in_end = 0;
    }
    ssize_t got = read(line.master, line.in + line.in_end, ROOM - line.in_end);
    for (ssize_t i = 0; i < got; i++) {
        line.frames += line.in[line.in_end + (size_t)i] == 0;
    }
    if (got > 0) {
        line.in_end += (size_t)got;
        line.taken += (unsigned long)got;
    }
}

void line_let_frame(void)
{
    while (line.in_let < line.in_end && line.in[line.in_let++] != 0) {
    }
}

void line_let_all(void)
{
    line.in_let = line.in_end;
}

int line_next(void)
{
    return line.in_first < line.in_let ? line.in[line.in_first++] : -1;
}

void line_put(uint8_t byte)
{
    if (line.out_end < ROOM) {
        line.out[line.out_end++] = byte;
    }
}

void line_give(void)
{
    ssize_t put = line.out_end > 0 ? write(line.master, line.out, line.out_end) : 0;
    if (put > 0) {
        line.out_end -= (size_t)put;
        line.given += (unsigned long)put;
        memmove(line.out, line.out + put, line.out_end);
    }
}

unsigned long line_taken(void)
{
    return line.taken;
}

unsigned long line_given(void)
{
    return line.given;
}

unsigned long line_frames(void)
{
    unsigned long frames = line.frames;
    line.frames = 0;
    return frames;
}
