#ifndef THICKLENS_TOOLS_INTERFACE_ABLATION_FILES_H_
#define THICKLENS_TOOLS_INTERFACE_ABLATION_FILES_H_

namespace thicklens {

// The files that an ablation adds to a simulated folder: a page and a machine-readable table. A run
// without an ablation has to know them too, because it may replace such a folder.
inline constexpr char kAblationPage[] = "attribution.html";
inline constexpr char kAblationTable[] = "attribution.csv";

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_ABLATION_FILES_H_
