#ifndef THICKLENS_TESTS_SUPPORT_SANITIZERS_H_
#define THICKLENS_TESTS_SUPPORT_SANITIZERS_H_

namespace thicklens::testing {

// True if this build checks memory or threads while it runs, which takes additional memory and
// time. GCC and clang define different macros.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif
#else
inline constexpr bool kIsSanitized = false;
#endif

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_SANITIZERS_H_
