// Holds a thread of llvmpipe's up for some milliseconds, now and then, just where it wakes others: in lp_fence_signal it
// has counted itself in by then and has not let go of the fence's lock. The system may do the same at any time.
// To be preloaded: cc -shared -fPIC slow_fences.c -o slow_fences.so -ldl
#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

static int (*wake)(pthread_cond_t *);
static unsigned count;

__attribute__((constructor)) static void find(void) {
  wake = (int (*)(pthread_cond_t *))dlvsym(RTLD_NEXT, "pthread_cond_broadcast", "GLIBC_2.3.2");
}

int pthread_cond_broadcast(pthread_cond_t *condition) {
  char name[16] = "";
  prctl(PR_GET_NAME, name);
  if (!strncmp(name, "llvmpipe-", 9) && __atomic_add_fetch(&count, 1, __ATOMIC_RELAXED) % 7 == 0) usleep(3000);
  return wake(condition);
}
