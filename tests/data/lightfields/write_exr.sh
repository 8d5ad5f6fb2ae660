#!/bin/bash
# Writes the .exr files of this folder with oiiotool (OpenImageIO) and the tools of OpenEXR.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
parts=() views=()
for row in 0 1; do
  for column in 0 1 2; do
    file=$folder/view_${row}_$column.exr
    colour=0.$((column + 1)),0.$((2 * row + 1)),0.5
    oiiotool --nosoftwareattrib --create 8x6 3 --fill:color="$colour" 8x6 -d half --compression zip -o "$file"
    parts+=("$file::view_${row}_$column")
    views+=("r${row}c$column" "$file")
  done
done
exrmultipart -combine -i "${parts[@]}" -o parts.exr
exrmultiview "${views[@]}" multiview.exr
exrmultipart -convert -i multiview.exr -o multiview-parts.exr
oiiotool --nosoftwareattrib "$folder"/view_0_0.exr "$folder"/view_0_1.exr --siappend -o unnamed-parts.exr
exrmultiview left "$folder"/view_0_0.exr right "$folder"/view_0_1.exr stereo.exr
exrmultipart -convert -i stereo.exr -o stereo-parts.exr
