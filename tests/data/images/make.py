#!/usr/bin/python3
"""Writes the files of this folder with programs that share no code with thicklens (see README.md).

Needs Debian's python3-tifffile, python3-pil, imagemagick, libtiff-tools, libheif-examples, openexr,
openimageio-tools and libimage-exiftool-perl.
"""
import os
import struct
import subprocess
import zlib

import numpy as np
import tifffile
from PIL import Image

W, H = 6, 5
x, y = np.meshgrid(np.arange(W), np.arange(H))
grey8 = (10 + 30 * x + 7 * y).astype('u1')
rgb8 = np.stack([grey8 + 20 * c for c in range(3)], axis=-1).astype('u1')
grey16 = (grey8.astype('u2') * 257 + x).astype('u2')
rgb16 = (rgb8.astype('u2') * 257 + x[..., None]).astype('u2')


def run(*command):
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


def tiff(name, values, **options):
    tifffile.imwrite(name, values, metadata=None, **options)


# TIFF by tifffile.
tiff('u16_contig.tif', rgb16, photometric='rgb')
tiff('u16_planar.tif', np.moveaxis(rgb16, -1, 0), photometric='rgb', planarconfig='separate')
big = np.tile(rgb16, (8, 8, 1))
tiff('u16_tiled.tif', big, photometric='rgb', tile=(16, 16))
tiff('u16_planar_tiled.tif', np.moveaxis(big, -1, 0), photometric='rgb', planarconfig='separate',
     tile=(16, 16))
tiff('u16_big_endian.tif', rgb16, photometric='rgb', byteorder='>')
tiff('u16_bigtiff.tif', rgb16, photometric='rgb', bigtiff=True)
tiff('u8.tif', rgb8, photometric='rgb')
tiff('i8.tif', (grey8.astype('i2') - 100).astype('i1'), photometric='minisblack')
tiff('i16.tif', (grey16.astype('i4') - 30000).astype('i2'), photometric='minisblack')
tiff('i32.tif', grey16.astype('i4') * 1000 - 20000000, photometric='minisblack')
tiff('u32.tif', grey16.astype('u4') * 65000, photometric='minisblack')
tiff('f16.tif', (grey8 / 4.0 - 8).astype('f2'), photometric='minisblack')
tiff('f32.tif', (grey8 / 4.0 - 8).astype('f4'), photometric='minisblack')
tiff('f64.tif', grey8 / 4.0 - 8, photometric='minisblack')
tiff('f32_be_planar.tif', np.moveaxis(rgb8, -1, 0).astype('f4') / 4, photometric='rgb',
     planarconfig='separate', byteorder='>')
tiff('c64.tif', grey8.astype('c8'), photometric='minisblack')
tiff('i64.tif', grey8.astype('i8'), photometric='minisblack')
tiff('straight_alpha.tif', np.dstack([rgb16, grey16]), photometric='rgb', extrasamples=['unassalpha'])
tiff('associated_alpha.tif', np.dstack([rgb16, grey16]), photometric='rgb',
     extrasamples=['assocalpha'])
tiff('grey_alpha.tif', np.dstack([grey16, grey16 // 2]), photometric='minisblack',
     planarconfig='contig', extrasamples=['unassalpha'])
tiff('palette.tif', (x + 6 * y).astype('u1'), photometric='palette',
     colormap=np.stack([np.arange(256) * k % 256 * 257 for k in (1, 3, 7)]).astype('u2'))
tiff('mosaic.tif', grey16[:4], photometric='cfa',
     extratags=[(33421, 'H', 2, (2, 2), True), (33422, 'B', 4, bytes([0, 1, 1, 2]), True)])
tiff('white_is_0.tif', 255 - grey8, photometric='miniswhite')
with tifffile.TiffWriter('pages.tif') as writer:
    for k in range(3):
        writer.write(grey16[:H - k] + k, photometric='minisblack', metadata=None)
tifffile.imwrite('stack.ome.tif', np.stack([grey8, grey8 + 1]), ome=True, photometric='minisblack',
                 metadata={'axes': 'ZYX', 'PhysicalSizeZ': 2.5, 'PhysicalSizeZUnit': 'µm'})
with tifffile.TiffWriter('pyramid.tif') as writer:
    writer.write(rgb8, photometric='rgb', metadata=None)
    writer.write(rgb8[::2, ::2], photometric='rgb', subfiletype=1, metadata=None)
tiff('orientation6.tif', rgb8, photometric='rgb', extratags=[(274, 'H', 1, 6, True)])
tifffile.imwrite('imagej.tif', np.stack([grey16, grey16 + 1]), imagej=True)
# Its second image has no directory of its own.
with open('imagej.tif', 'r+b') as file:
    data = bytearray(file.read())
    order = '<' if data[:2] == b'II' else '>'
    at, = struct.unpack_from(order + 'I', data, 4)
    count, = struct.unpack_from(order + 'H', data, at)
    struct.pack_into(order + 'I', data, at + 2 + 12 * count, 0)
    file.seek(0)
    file.write(data)

# TIFF by Pillow and ImageMagick, and the compressions by tiffcp.
Image.fromarray(grey8 > 100).save('bilevel.tif', compression='group4')
# 12 bits in 1.5 bytes, by hand: the values are 16 times those of 8 bits, plus x.
values12 = (grey8.astype('u2') * 16 + x).astype('u2')
rows = b''
for row in values12:
    bits = ''.join(f'{v:012b}' for v in row)
    rows += bytes(int(bits[i:i + 8], 2) for i in range(0, len(bits), 8))
tags = [(256, 4, W), (257, 4, H), (258, 3, 12), (259, 3, 1), (262, 3, 1), (273, 4, 8), (277, 3, 1),
        (278, 4, H), (279, 4, len(rows))]
rows_padded = rows + b'\0' * (len(rows) % 2)
with open('u12_packed.tif', 'wb') as file:
    file.write(b'II*\0' + struct.pack('<I', 8 + len(rows_padded)) + rows_padded)
    file.write(struct.pack('<H', len(tags)))
    for tag, kind, value in tags:
        file.write(struct.pack('<HHII', tag, kind, 1, value))
    file.write(b'\0\0\0\0')
for compression in ('lzw', 'zip', 'packbits', 'zstd', 'lzma', 'lzw:2', 'zip:2'):
    name = 'u16_' + compression.replace(':', '_predictor') + '.tif'
    run('tiffcp', '-c', compression, 'u16_contig.tif', name)
run('tiffcp', '-c', 'zip:3', 'f32.tif', 'f32_zip_predictor3.tif')
smooth = np.stack([np.tile(np.linspace(40 + 20 * c, 200, 32), (24, 1)) for c in range(3)], -1)
Image.fromarray(np.round(smooth).astype('u1')).save('smooth.png')
run('convert', 'smooth.png', '-colorspace', 'sRGB', '-compress', 'jpeg', '-quality', '98',
    'ycbcr_jpeg.tif')
run('convert', 'smooth.png', '-colorspace', 'CMYK', 'cmyk.tif')
run('convert', 'smooth.png', '-colorspace', 'CMYK', 'cmyk.jpg')
run('convert', 'smooth.png', '-colorspace', 'Lab', 'lab.tif')

# JPEG, WebP and BMP by ImageMagick and Pillow; EXIF by exiftool.
Image.fromarray(np.round(smooth[..., 0]).astype('u1')).save('grey.jpg', quality=97)
for k in range(1, 9):
    run('convert', 'smooth.png', '-crop', '32x16+0+0', '+repage', '-quality', '97',
        f'orientation{k}.jpg')
    run('exiftool', '-q', '-overwrite_original', '-n', f'-Orientation={k}', f'orientation{k}.jpg')
run('exiftool', '-q', '-overwrite_original', '-FocalPlaneXResolution=2000',
    '-FocalPlaneYResolution=2000', '-FocalPlaneResolutionUnit=cm', 'orientation1.jpg')
alpha = (255 - 40 * x).astype('u1')
Image.fromarray(np.dstack([rgb8, alpha])).save('alpha.webp', lossless=True, exact=True)
Image.fromarray(rgb8).save('animated.webp', lossless=True, save_all=True,
                           append_images=[Image.fromarray(rgb8[::-1])])
Image.fromarray(rgb8).save('rgb.bmp')
Image.fromarray(grey8).save('grey.bmp')
Image.fromarray(np.dstack([rgb8, alpha])).save('straight_alpha.png')


# PNG by hand: any chunk.
def png(name, values, bits, colour, chunks=()):
    def chunk(kind, content):
        return (struct.pack('>I', len(content)) + kind + content
                + struct.pack('>I', zlib.crc32(kind + content)))
    if bits == 16:
        rows = values.astype('>u2').reshape(len(values), -1)
        lines = b''.join(b'\0' + row.tobytes() for row in rows)
    elif bits == 8:
        lines = b''.join(b'\0' + row.astype('u1').tobytes() for row in values.reshape(len(values), -1))
    else:
        lines = b''
        for row in values:
            text = ''.join(f'{int(v):0{bits}b}' for v in row)
            text += '0' * (-len(text) % 8)
            lines += b'\0' + bytes(int(text[i:i + 8], 2) for i in range(0, len(text), 8))
    header = struct.pack('>IIBBBBB', values.shape[1], values.shape[0], bits, colour, 0, 0, 0)
    with open(name, 'wb') as file:
        file.write(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header))
        for kind, content in chunks:
            file.write(chunk(kind, content))
        file.write(chunk(b'IDAT', zlib.compress(lines)) + chunk(b'IEND', b''))


exif6 = b'MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0'
primaries = struct.pack('>8I', 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
png('gamma.png', rgb16, 16, 2, [(b'gAMA', struct.pack('>I', 45455)), (b'cHRM', primaries)])
png('linear.png', rgb16, 16, 2, [(b'gAMA', struct.pack('>I', 100000)), (b'sBIT', bytes([12] * 3))])
png('srgb.png', rgb8, 8, 2, [(b'gAMA', struct.pack('>I', 45455)), (b'sRGB', b'\0')])
png('pq.png', rgb16, 16, 2, [(b'cICP', bytes([9, 16, 0, 1])), (b'gAMA', struct.pack('>I', 45455))])
png('hlg.png', rgb16, 16, 2, [(b'cICP', bytes([9, 18, 0, 1]))])
png('orientation6.png', rgb8, 8, 2, [(b'eXIf', exif6)])
png('u4.png', grey8 // 16, 4, 0)
png('grey_alpha16.png', np.dstack([grey16, grey16 // 2]), 16, 4)
text = 'Test profile'.encode('utf-16-be')
desc = (b'mluc\0\0\0\0' + struct.pack('>II', 1, 12) + b'enUS' + struct.pack('>II', len(text), 28)
        + text)
profile = (struct.pack('>I', 144 + len(desc)) + b'\0' * 124 + struct.pack('>I', 1) + b'desc'
           + struct.pack('>II', 144, len(desc)) + desc)
png('profile.png', rgb8, 8, 2, [(b'iCCP', b'any name\0\0' + zlib.compress(profile))])
Image.fromarray(np.round(smooth).astype('u1')).save('smooth.jpg', quality=97, subsampling=0,
                                                   icc_profile=profile)
Image.fromarray(rgb8).save('plain.webp', lossless=True, icc_profile=profile)


# EXR by hand: one part, scan lines, not compressed.
def exr(name, planes, window=None, display=None, attributes=()):
    kinds = {'u4': 0, 'f2': 1, 'f4': 2}
    names = sorted(planes)
    rows, columns = planes[names[0]].shape
    x0, y0 = window or (0, 0)
    box = (x0, y0, x0 + columns - 1, y0 + rows - 1)
    display = display or box

    def attribute(key, kind, value):
        return key.encode() + b'\0' + kind.encode() + b'\0' + struct.pack('<I', len(value)) + value
    channels = b''.join(n.encode() + b'\0' + struct.pack('<IIII', kinds[planes[n].dtype.str[1:]], 0, 1, 1)
                        for n in names) + b'\0'
    head = b'\x76\x2f\x31\x01\x02\0\0\0'
    head += attribute('channels', 'chlist', channels) + attribute('compression', 'compression', b'\0')
    head += attribute('dataWindow', 'box2i', struct.pack('<4i', *box))
    head += attribute('displayWindow', 'box2i', struct.pack('<4i', *display))
    head += attribute('lineOrder', 'lineOrder', b'\0')
    head += attribute('pixelAspectRatio', 'float', struct.pack('<f', 1))
    head += attribute('screenWindowCenter', 'v2f', struct.pack('<2f', 0, 0))
    head += attribute('screenWindowWidth', 'float', struct.pack('<f', 1))
    for extra in attributes:
        head += attribute(*extra)
    head += b'\0'
    lines = []
    for row in range(rows):
        data = b''.join(planes[n][row].astype('<' + planes[n].dtype.str[1:]).tobytes() for n in names)
        lines.append(struct.pack('<iI', y0 + row, len(data)) + data)
    at = len(head) + 8 * rows
    table = b''
    for line in lines:
        table += struct.pack('<Q', at)
        at += len(line)
    with open(name, 'wb') as file:
        file.write(head + table + b''.join(lines))


depth = (grey8 / 4.0 + 100).astype('f4')
exr('rgb_half.exr', {'R': (rgb8[..., 0] / 64).astype('f2'), 'G': (rgb8[..., 1] / 64).astype('f2'),
                     'B': (rgb8[..., 2] / 64).astype('f2')},
    attributes=[('chromaticities', 'chromaticities',
                 struct.pack('<8f', .64, .33, .3, .6, .15, .06, .3127, .329))])
exr('z.exr', {'Z': depth})
exr('layer_z.exr', {'depth.Z': depth.astype('f2')})
exr('mixed.exr', {'R': depth.astype('f2'), 'Z': depth, 'id': (grey16.astype('u4') * 65000)})
exr('window.exr', {'Z': depth}, window=(2, -1), display=(0, 0, 7, 5))
exr('left.exr', {'Y': depth}, attributes=[('name', 'string', b'left')])
exr('right.exr', {'Y': depth + 1}, attributes=[('name', 'string', b'right')])
run('exrmultipart', '-combine', '-i', 'left.exr', 'right.exr', '-o', 'parts.exr', '-override', '1')
run('exrmultipart', '-combine', '-i', 'rgb_half.exr', 'z.exr', '-o', 'rgb_and_z.exr')
exr('left.exr', {'Z': depth}, attributes=[('name', 'string', b'left')])
exr('right.exr', {'Z': depth + 1}, attributes=[('name', 'string', b'right')])
run('exrmultipart', '-combine', '-i', 'left.exr', 'right.exr', '-o', 'stereo_z.exr', '-override', '1')
exr('left.exr', {'Y': depth}, attributes=[('name', 'string', b'depth')])
run('exrmultipart', '-combine', '-i', 'rgb_half.exr', 'left.exr', '-o', 'named_part.exr')
run('oiiotool', 'z.exr', '--deepen', '-o', 'right.exr')
run('exrmultipart', '-combine', '-i', 'right.exr', 'z.exr', '-o', 'deep_and_z.exr', '-override', '1')
exr('mist.exr', {'R': depth.astype('f2'), 'G': (depth + 1).astype('f2'),
                 'B': (depth + 2).astype('f2'), 'Mist': depth})
os.remove('left.exr')
os.remove('right.exr')

# PNM and PFM by hand and by ImageMagick.
with open('u12.pgm', 'wb') as file:
    file.write(b'P5\n# a comment\n6 5\n4095\n' + (grey16 // 16).astype('>u2').tobytes())
with open('u16.ppm', 'wb') as file:
    file.write(b'P6 6 5 65535\n' + rgb16.astype('>u2').tobytes())
run('convert', 'smooth.png', '-compress', 'none', 'text.ppm')
Image.fromarray(grey8 > 100).save('bits.pbm')
with open('alpha.pam', 'wb') as file:
    file.write(b'P7\nWIDTH 6\nHEIGHT 5\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n'
               + np.dstack([rgb8, alpha]).tobytes())
with open('big_endian.pfm', 'wb') as file:
    file.write(b'Pf\n6 5\n2.0\n' + depth[::-1].astype('>f4').tobytes())
with open('crlf.pfm', 'wb') as file:
    file.write(b'PF\r\n6 5\r\n-1.0\r\n' + (rgb8[::-1] / 4).astype('<f4').tobytes())

# HEIC and AVIF by heif-enc, without loss.
Image.fromarray(np.tile(rgb8, (13, 11, 1))[:, :64]).save('heif_source.png')
run('heif-enc', '-L', 'heif_source.png', '-o', 'rgb.heic')
png('heif_source16.png', np.tile(rgb16, (13, 11, 1))[:, :64], 16, 2)
run('heif-enc', '-L', '-b', '10', 'heif_source16.png', '-o', 'u10.heic')
run('heif-enc', '-A', '-b', '12', 'heif_source16.png', '-o', 'u12.avif')
os.remove('heif_source.png')
os.remove('heif_source16.png')
# Two tiles that state BT.2020 with PQ; the image that they make states nothing (its third property
# becomes its second once more).
y, x = np.mgrid[:64, :128]
Image.fromarray(np.stack([(x + y) % 256, x, 2 * y], axis=-1).astype(np.uint8)).save('tiles_source.png')
run('avifenc', '--grid', '2x1', '-d', '8', '--cicp', '9/16/9', '--min', '0', '--max', '5', '-s', '8',
    'tiles_source.png', 'tiles.avif')
os.remove('tiles_source.png')
with open('tiles.avif', 'rb') as file:
    tiles = file.read()
with open('tiles.avif', 'wb') as file:
    file.write(tiles.replace(bytes([0, 1, 3, 1, 2, 3]), bytes([0, 1, 3, 1, 2, 2]), 1))
# The box of bits per channel, which is optional, becomes a turn or a mirror.
with open('rgb.heic', 'rb') as file:
    heic = file.read()
at = heic.index(b'pixi')
for name, kind, value in (('turned1.heic', b'irot', 1), ('turned3.heic', b'irot', 3),
                          ('mirrored0.heic', b'imir', 0), ('mirrored1.heic', b'imir', 1)):
    with open(name, 'wb') as file:
        file.write(heic[:at] + kind + bytes([value]) + heic[at + 5:])


# A DICOM file by hand: 12 bits.
def element(group, number, kind, value):
    if len(value) % 2:
        value += b'\0' if kind == 'UI' else b' '
    if kind in ('OB', 'OW'):
        return struct.pack('<HH2sHI', group, number, kind.encode(), 0, len(value)) + value
    return struct.pack('<HH2sH', group, number, kind.encode(), len(value)) + value


def short(value):
    return struct.pack('<H', value)


meta = (element(2, 2, 'UI', b'1.2.840.10008.5.1.4.1.1.7') + element(2, 3, 'UI', b'1.2.3')
        + element(2, 0x10, 'UI', b'1.2.840.10008.1.2.1'))
body = (element(8, 0x16, 'UI', b'1.2.840.10008.5.1.4.1.1.7') + element(8, 0x18, 'UI', b'1.2.3')
        + element(0x28, 2, 'US', short(1)) + element(0x28, 4, 'CS', b'MONOCHROME2')
        + element(0x28, 0x10, 'US', short(H)) + element(0x28, 0x11, 'US', short(W))
        + element(0x28, 0x100, 'US', short(16)) + element(0x28, 0x101, 'US', short(12))
        + element(0x28, 0x102, 'US', short(11)) + element(0x28, 0x103, 'US', short(0))
        + element(0x7FE0, 0x10, 'OW', (grey16 // 16).astype('<u2').tobytes()))
with open('u12.dcm', 'wb') as file:
    file.write(b'\0' * 128 + b'DICM' + element(2, 0, 'UL', struct.pack('<I', len(meta))) + meta + body)


# A DNG file by hand: a preview of 16 x 12 px in the first directory, the mosaic of 64 x 48 px in
# another; black 256, white 4095, RGGB, white balance 2, 1, 1.5.
def dng(name, mosaic, preview, black, white, orientation=1, pattern=(0, 1, 1, 2), balance=True):
    data = bytearray(b'II*\0\0\0\0\0')

    def add(content):
        at = len(data)
        data.extend(content + b'\0' * (len(content) % 2))
        return at

    def directory(tags):
        at = len(data)
        entries = b''
        for tag, kind, values in sorted(tags):
            size = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8}[kind]
            content = {1: lambda: bytes(values), 2: lambda: values,
                       3: lambda: struct.pack(f'<{len(values)}H', *values),
                       4: lambda: struct.pack(f'<{len(values)}I', *values),
                       5: lambda: struct.pack(f'<{len(values)}I', *values),
                       10: lambda: struct.pack(f'<{len(values)}i', *values)}[kind]()
            entries += struct.pack('<HHI', tag, kind, len(content) // size)
            entries += content.ljust(4, b'\0') if len(content) <= 4 else struct.pack('<I', add(content))
        at = len(data)
        data.extend(struct.pack('<H', len(tags)) + entries + b'\0\0\0\0')
        return at
    height, width = mosaic.shape
    raw_at = add(mosaic.astype('<u2').tobytes())
    preview_at = add(preview.tobytes())
    sub = directory([
        (254, 4, [0]), (256, 4, [width]), (257, 4, [height]), (258, 3, [16]), (259, 3, [1]),
        (262, 3, [32803]), (273, 4, [raw_at]), (277, 3, [1]), (278, 4, [height]),
        (279, 4, [2 * mosaic.size]), (33421, 3, [2, 2]), (33422, 1, pattern), (50713, 3, [1, 1]),
        (50714, 3, [black]), (50717, 3, [white])])
    main = directory([
        (254, 4, [1]), (256, 4, [preview.shape[1]]), (257, 4, [preview.shape[0]]), (258, 3, [8, 8, 8]),
        (259, 3, [1]), (262, 3, [2]), (271, 2, b'Maker\0'), (272, 2, b'Model\0'),
        (273, 4, [preview_at]), (274, 3, [orientation]), (277, 3, [3]), (278, 4, [preview.shape[0]]),
        (279, 4, [preview.size]), (330, 4, [sub]), (50706, 1, [1, 4, 0, 0]),
        (50707, 1, [1, 1, 0, 0]), (50708, 2, b'Maker Model\0'),
        (50721, 10, [10000, 10000, 0, 1, 0, 1, 0, 1, 10000, 10000, 0, 1, 0, 1, 0, 1, 10000, 10000]),
        (50778, 3, [21])] + ([(50728, 5, [1, 2, 1, 1, 2, 3])] if balance else []))
    struct.pack_into('<I', data, 4, main)
    with open(name, 'wb') as file:
        file.write(data)


mx, my = np.meshgrid(np.arange(64), np.arange(48))
light = 0.2 + 0.5 * mx / 63
mosaic = 256 + np.round((4095 - 256) * light * np.where((mx + my) % 2 == 1, 1,
                                                        np.where(my % 2 == 0, 0.5, 2 / 3)))
dng('mosaic.dng', mosaic, np.full((12, 16, 3), 200, 'u1'), 256, 4095)
dng('turned.dng', mosaic, np.full((12, 16, 3), 200, 'u1'), 256, 4095, orientation=6)
dng('no_balance.dng', mosaic, np.full((12, 16, 3), 200, 'u1'), 256, 4095, balance=False)
