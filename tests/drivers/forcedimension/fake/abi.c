/* A C caller of the SDK. Without an argument it prints each function as the compiler sees it: name, result, arguments,
 * as i4 (kind and bytes) or *f8 (a pointer to that). With one it plays a short session and prints what came of it. */
#include "fake.h"

#include <stdio.h>

#define NAMED(t, v) \
    _Generic((v), bool: "b", char: "c", unsigned char: "u", unsigned short: "u", int: "i", unsigned int: "u", double: "f", \
             bool *: "*b", char *: "*c", const char *: "*c", unsigned char *: "*u", unsigned short *: "*u", int *: "*i", \
             unsigned int *: "*u", double *: "*f")
#define SIZE(t, v) \
    _Generic((v), char *: sizeof(char), const char *: sizeof(char), unsigned char *: sizeof(unsigned char), \
             unsigned short *: sizeof(unsigned short), int *: sizeof(int), unsigned int *: sizeof(unsigned int), \
             double *: sizeof(double), default: sizeof(t))
#define ONE(t) printf(" %s%zu", NAMED(t, (t){0}), SIZE(t, (t){0}));

#define EACH_0()
#define EACH_1(a) ONE(a)
#define EACH_2(a, ...) ONE(a) EACH_1(__VA_ARGS__)
#define EACH_3(a, ...) ONE(a) EACH_2(__VA_ARGS__)
#define EACH_4(a, ...) ONE(a) EACH_3(__VA_ARGS__)
#define EACH_5(a, ...) ONE(a) EACH_4(__VA_ARGS__)
#define EACH_6(a, ...) ONE(a) EACH_5(__VA_ARGS__)
#define EACH_7(a, ...) ONE(a) EACH_6(__VA_ARGS__)
#define EACH_8(a, ...) ONE(a) EACH_7(__VA_ARGS__)
#define PICK(_0, _1, _2, _3, _4, _5, _6, _7, _8, n, ...) EACH_##n
#define EACH(...) PICK(_0 __VA_OPT__(,) __VA_ARGS__, 8, 7, 6, 5, 4, 3, 2, 1, 0)(__VA_ARGS__)

#define RESULT(type) \
    _Generic((type *)0, void *: "v", int *: "i4", unsigned int *: "u4", bool *: "b1", double *: "f8", const char **: "*c1")
_Static_assert(sizeof(int) == 4 && sizeof(bool) == 1 && sizeof(double) == 8, "the results' sizes above");

static void print_functions(void) {
#define F(type, name, ...) \
    printf("%s %s", #name, RESULT(type)); \
    EACH(__VA_ARGS__) \
    puts("");
#include "functions.h"
#undef F
}

static void play(void) {
    double x = 0, y = 0, z = 0, matrix[9], firmware = 0;
    unsigned short serial = 0;
    int status[17], major, minor, release, revision, result;
    int id = drdOpenID(0);
    result = dhdGetSerialNumber(&serial, (char)id);
    printf("%d %d %d %d\n", id, dhdGetSystemType((char)id), result, serial);
    result = dhdSetWatchdog(80, (char)id); /* without expert mode */
    printf("%d %d\n", result, dhdErrorGetLast());
    result = dhdGetVersion(&firmware, (char)id);
    printf("%d %.17g\n", result, firmware);
    dhdGetSDKVersion(&major, &minor, &release, &revision);
    printf("%d %d %d %d\n", major, minor, release, revision);
    result = dhdEnableForce(1, (char)id);
    printf("%d %d\n", result, drdIsInitialized((char)id));
    for (int tick = 0; tick < 50; tick++) {
        int got = dhdGetPositionAndOrientationFrame(&x, &y, &z, matrix, (char)id);
        int set = dhdSetForceAndTorqueAndGripperForce(1.5, -2.5, 0.25 * tick, 0, 0, 0, 0, (char)id);
        printf("%d %d %.17g %.17g %.17g %.17g\n", got, set, x, y, z, matrix[0] + matrix[4] + matrix[8]);
    }
    result = dhdGetStatus(status, (char)id);
    printf("%d", result);
    for (int at = 0; at < 17; at++)
        printf(" %d", status[at]);
    result = dhdStop((char)id);
    printf("\n%d %d\n", result, drdClose((char)id));
}

int main(int count, char **arguments) {
    (void)arguments;
    if (count > 1)
        play();
    else
        print_functions();
    return 0;
}
