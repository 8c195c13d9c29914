/* Makes one call of the C library fail: PLUMBLINE_FAULT="KIND:NUMBER:ERRNO" fails the NUMBER-th call of the kind, from 1.
 * PLUMBLINE_FAULT_COUNTS=FILE writes at the end how many calls of each kind there were. Reads and writes count where they are
 * of regular files: not of pipes, terminals and what threads wake each other with. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum kind { READ, WRITE, RENAME, SYNC, OPEN, THREAD, KINDS };
static const char *const names[KINDS] = {"read", "write", "rename", "sync", "open", "thread"};
static atomic_long counts[KINDS];
static int chosen = -1, code;
static long number;
enum { ORDER = 4096 };
static char order[ORDER];
static atomic_long ordered;

static void note(char what)
{
    long at = atomic_fetch_add(&ordered, 1);
    if (at < ORDER)
        order[at] = what;
}

__attribute__((constructor)) static void start(void)
{
    const char *text = getenv("PLUMBLINE_FAULT");
    char kind[16];
    if (text && sscanf(text, "%15[a-z]:%ld:%d", kind, &number, &code) == 3)
        for (int k = 0; k < KINDS; k++)
            if (!strcmp(kind, names[k]))
                chosen = k;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("PLUMBLINE_FAULT_COUNTS");
    FILE *file = path ? fopen(path, "a") : NULL; /* a batch has several processes */
    if (!file)
        return;
    for (int k = 0; k < KINDS; k++)
        fprintf(file, "%s %ld\n", names[k], (long)counts[k]);
    fprintf(file, "order %.*s\n", (int)(ordered < ORDER ? ordered : ORDER), order);
    fclose(file);
}

/* Syncs of files (f) and folders (d) and renames (r), in order. */
static void note_sync(int fd)
{
    struct stat about;
    note(!fstat(fd, &about) && S_ISDIR(about.st_mode) ? 'd' : 'f');
}

static int fails(enum kind kind)
{
    long count = atomic_fetch_add(&counts[kind], 1) + 1;
    return chosen == (int)kind && count == number;
}

static int regular(int fd)
{
    int before = errno;
    struct stat about;
    int is = fd > 2 && !fstat(fd, &about) && S_ISREG(about.st_mode);
    errno = before;
    return is;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL_IF(condition) do { if (condition) { errno = code; return -1; } } while (0)

ssize_t read(int fd, void *to, size_t n) { FAIL_IF(regular(fd) && fails(READ)); return REAL(read)(fd, to, n); }
ssize_t pread(int fd, void *to, size_t n, off_t at) { FAIL_IF(regular(fd) && fails(READ)); return REAL(pread)(fd, to, n, at); }
ssize_t pread64(int fd, void *to, size_t n, off64_t at) { FAIL_IF(regular(fd) && fails(READ)); return REAL(pread64)(fd, to, n, at); }
ssize_t write(int fd, const void *of, size_t n) { FAIL_IF(regular(fd) && fails(WRITE)); return REAL(write)(fd, of, n); }
ssize_t writev(int fd, const struct iovec *of, int n) { FAIL_IF(regular(fd) && fails(WRITE)); return REAL(writev)(fd, of, n); }
ssize_t pwrite64(int fd, const void *of, size_t n, off64_t at) { FAIL_IF(regular(fd) && fails(WRITE)); return REAL(pwrite64)(fd, of, n, at); }
int rename(const char *from, const char *to) { note('r'); FAIL_IF(fails(RENAME)); return REAL(rename)(from, to); }
int renameat2(int a, const char *from, int b, const char *to, unsigned int flags) { note('r'); FAIL_IF(fails(RENAME)); return REAL(renameat2)(a, from, b, to, flags); }
int fsync(int fd) { note_sync(fd); FAIL_IF(fails(SYNC)); return REAL(fsync)(fd); }
int fdatasync(int fd) { note_sync(fd); FAIL_IF(fails(SYNC)); return REAL(fdatasync)(fd); }

#define MODE(flags) mode_t mode = 0; if (flags & (O_CREAT | O_TMPFILE)) { va_list rest; va_start(rest, flags); mode = va_arg(rest, mode_t); va_end(rest); }
int open(const char *path, int flags, ...) { MODE(flags) FAIL_IF(fails(OPEN)); return REAL(open)(path, flags, mode); }
int open64(const char *path, int flags, ...) { MODE(flags) FAIL_IF(fails(OPEN)); return REAL(open64)(path, flags, mode); }
int openat(int at, const char *path, int flags, ...) { MODE(flags) FAIL_IF(fails(OPEN)); return REAL(openat)(at, path, flags, mode); }
int openat64(int at, const char *path, int flags, ...) { MODE(flags) FAIL_IF(fails(OPEN)); return REAL(openat64)(at, path, flags, mode); }

/* PLUMBLINE_FREE_SPACE=BYTES: what every file system has left. */
#define STATVFS(name) \
    int name(const char *path, struct name *about) \
    { \
        const char *text = getenv("PLUMBLINE_FREE_SPACE"); \
        int done = REAL(name)(path, about); \
        if (!done && text) \
            about->f_bavail = (unsigned long)atoll(text) / about->f_frsize; \
        return done; \
    }
STATVFS(statvfs)
STATVFS(statvfs64)

int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*work)(void *), void *with)
{
    return fails(THREAD) ? code : REAL(pthread_create)(thread, how, work, with);
}
