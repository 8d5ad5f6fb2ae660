#ifndef THICKLENS_TOOLS_SYSTEM_SANITIZED_H_
#define THICKLENS_TOOLS_SYSTEM_SANITIZED_H_

// THICKLENS_IS_SANITIZED is defined in builds that check memory or threads while they run. GCC and
// clang say it in different ways.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define THICKLENS_IS_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define THICKLENS_IS_SANITIZED 1
#endif
#endif

#endif  // THICKLENS_TOOLS_SYSTEM_SANITIZED_H_
