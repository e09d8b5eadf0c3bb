/* Attributes of public declarations, and C linkage for the few C++ adapters. */
#ifndef TSUYA_CORE_API_H
#define TSUYA_CORE_API_H

#ifdef __cplusplus
#define TSUYA_EXTERN_C extern "C"
#else
#define TSUYA_EXTERN_C extern
#endif

/* Only what carries TSUYA_API is visible outside libtsuya.so (everything else is built with -fvisibility=hidden). */
#define TSUYA_API TSUYA_EXTERN_C __attribute__((visibility("default")))
#ifdef __cplusplus
#define TSUYA_MUST_CHECK /* an attribute may not stand before C++'s linkage; C callers are checked */
#else
#define TSUYA_MUST_CHECK __attribute__((warn_unused_result))
#endif
#define TSUYA_PRINTF(format_index, first_argument) __attribute__((format(printf, format_index, first_argument)))

/* A function that crosses between C and a C++ adapter inside the library: C linkage, not exported. */
#define TSUYA_INTERNAL TSUYA_EXTERN_C

#endif
