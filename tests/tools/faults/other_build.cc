// Libraries that the program loads, of another build than the program. THICKLENS_HAS_IDENTITY is 0
// for builds from before there was an identity.
extern "C" __attribute__((visibility("default"))) const void* ThicklensImageLibrary() {
  __builtin_trap();  // its objects may have another layout
}

#if THICKLENS_HAS_IDENTITY
extern "C" __attribute__((visibility("default"))) const char* ThicklensPluginIdentity() {
  return "0.0.0-of-another-build";
}
#endif
