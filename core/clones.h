/* One function compiled for several instruction sets; the program takes the best when it starts.
 * Usage: TSUYA_CLONES("avx2", "default") static void f(…).  Under the thread sanitizer, which is not ready yet when that
 * choice is made, there is one version only. */
#ifndef TSUYA_CORE_CLONES_H
#define TSUYA_CORE_CLONES_H

#ifdef __SANITIZE_THREAD__
#define TSUYA_CLONES(...)
#else
#define TSUYA_CLONES(...) __attribute__((target_clones(__VA_ARGS__)))
#endif

#endif
