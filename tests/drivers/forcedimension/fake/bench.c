/* Memory of the devices, time, the last error of each thread, and the fake_ symbols that tests hold. */
#define _GNU_SOURCE
#include "fake.h"

#include <fcntl.h>
#include <sched.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

enum { LOGGED = 512, NAME = 48 };

struct field {
    const char *name;
    size_t offset;
    double value;
};

#define DEVICE_SCALAR(name, value) {#name, offsetof(struct device, name), value},
#define DEVICE_VECTOR(name) {#name, offsetof(struct device, name), 0},
#define BENCH_SCALAR(name, value) {#name, offsetof(struct bench, name), value},
#define BENCH_VECTOR(name) {#name, offsetof(struct bench, name), 0},
static const struct field device_fields[] = {DEVICE_FIELDS(DEVICE_SCALAR, DEVICE_VECTOR){0, 0, 0}};
static const struct field bench_fields[] = {BENCH_FIELDS(BENCH_SCALAR, BENCH_VECTOR){0, 0, 0}};

struct bench *bench;
int open_here[DEVICES];
static __thread int thread_error;
static const char *logged[LOGGED];
static int logged_count;

static void set_defaults(void *of, const struct field *fields) {
    for (; fields->name; fields++)
        *(double *)((char *)of + fields->offset) = fields->value;
}

static void make(struct bench *made) {
    memset(made, 0, sizeof *made);
    set_defaults(made, bench_fields);
    for (int id = 0; id < DEVICES; id++) {
        set_defaults(&made->device[id], device_fields);
        made->device[id].serial += id;
    }
}

/* Plug this process into a bench: the one in a file, made if it is new, or for NULL a new one of its own. */
int fake_attach(const char *file) {
    static struct bench own;
    if (bench && bench != &own)
        munmap(bench, sizeof *bench);
    bench = NULL;
    memset(open_here, 0, sizeof open_here);
    logged_count = 0;
    if (!file) {
        bench = &own;
        make(bench);
        return 0;
    }
    int fd = open(file, O_RDWR | O_CREAT, 0600);
    if (fd < 0)
        return -1;
    off_t size = lseek(fd, 0, SEEK_END);
    if (size < (off_t)sizeof *bench && ftruncate(fd, sizeof *bench))
        return -1;
    void *memory = mmap(0, sizeof *bench, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    if (memory == MAP_FAILED)
        return -1;
    bench = memory;
    if (size < (off_t)sizeof *bench)
        make(bench);
    return 0;
}

/* What a program's death leaves: devices as they are, and nothing open. */
void fake_die(void) { memset(open_here, 0, sizeof open_here); }

struct bench *the_bench(void) {
    if (!bench)
        fake_attach(getenv("FAKE_DHD_FILE"));
    return bench;
}

static double *find(int id, const char *name, int index) {
    the_bench();
    const struct field *field = id < 0 ? bench_fields : device_fields;
    char *of = id < 0 ? (char *)bench : (char *)&bench->device[id];
    for (; field->name; field++)
        if (!strcmp(field->name, name))
            return (double *)(of + field->offset) + index;
    abort();
}

void fake_set(int id, const char *name, int index, double value) { *find(id, name, index) = value; }

double fake_get(int id, const char *name, int index) {
    double *value = find(id, name, index);
    if (id >= 0 && bench->device[id].present)
        settle(&bench->device[id]);
    return *value;
}

/* Time passes with nobody calling: what the devices do by themselves shows at the next look. */
void fake_advance(double us) {
    the_bench();
    pass(us);
}

void fake_press_force_button(int id) {
    struct device *d = &the_bench()->device[id];
    if (!d->button_off)
        trip(d, BUTTON);
    d->button_off = 0;
}

int fake_last_error(void) { return thread_error; }

void fake_clear_log(void) { logged_count = 0; }

/* The names of the calls since the log was cleared, or the number of them. */
int fake_log(char *names, int size) {
    names[0] = 0;
    for (int at = 0; at < logged_count && at < LOGGED; at++)
        if ((int)(strlen(names) + strlen(logged[at]) + 2) < size)
            strcat(strcat(names, logged[at]), " ");
    return logged_count;
}

void log_call(const char *name) {
    the_bench();
    if (logged_count < LOGGED)
        logged[logged_count] = name;
    logged_count++;
}

void note_processors(struct device *d) {
    cpu_set_t allowed;
    d->processors = sched_getaffinity(0, sizeof allowed, &allowed) ? 0 : CPU_COUNT(&allowed);
}

double monotonic_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1e6 + now.tv_nsec * 1e-3;
}

double now_us(void) { return bench->virtual_us + bench->wall_scale * monotonic_us(); }

double watch_us(void) { return bench->watched_us + bench->wall_scale * monotonic_us(); }

void pass(double us) {
    bench->virtual_us += us;
    bench->watched_us += us;
}

int last_error(void) { return thread_error; }

int fail(int error) {
    thread_error = error;
    return -1;
}

struct device *device_of(int id) {
    struct device *d = &bench->device[id < 0 || id >= DEVICES ? 0 : id];
    if (id < 0 || id >= DEVICES || !open_here[id]) {
        d->misuse++; /* the default device, or one that is not open: hapticd names an open device each time */
        fail(INVALID);
        return 0;
    }
    if (settle(d) < 0) {
        fail(COM);
        return 0;
    }
    return d;
}
