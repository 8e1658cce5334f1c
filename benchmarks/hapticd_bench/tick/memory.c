/* What a tick does to the machine's memory, and nothing else: one byte of each of some pages. */

enum { PAGE = 4096, LINE = 64 };

unsigned read_pages(const volatile unsigned char *memory, long pages) {
    unsigned sum = 0;
    for (long page = 0; page < pages; page++)
        sum += memory[page * PAGE + page * LINE % PAGE]; /* another line in each, or they share few cache sets */
    return sum;
}
