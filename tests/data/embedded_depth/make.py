#!/usr/bin/env python3
"""Makes the files of this folder. README.md states what they hold.

JPEG: the images are coded by ImageMagick, and exiftool writes the XMP and splits it where it is
longer than a segment. exiftool writes no index of further images (MPF, CIPA DC-007); the one here
is written by this program, and so is what stands behind the images.

HEIC: the images are coded by heif-enc (Debian 12, libheif 1.15.1 with x265). heif-enc writes no
depth image, so that this program puts its two files into one, box by box (ISO/IEC 14496-12,
23008-12): the photograph, the depth image with the property auxC and the reference auxl, and its
XMP with the reference cdsc, in the order and with the names that the cameras of Apple use.
"""
import os, struct, subprocess, tempfile, zlib

HERE = os.path.dirname(os.path.abspath(__file__))
WIDTH, HEIGHT, SMALL_WIDTH, SMALL_HEIGHT = 256, 128, 128, 64


def png(path, width, height, channels, value):
    rows = b''.join(b'\0' + bytes(v for x in range(width) for v in value(x, y))
                    for y in range(height))
    def chunk(kind, data):
        body = kind + data
        return struct.pack('>I', len(data)) + body + struct.pack('>I', zlib.crc32(body))
    header = struct.pack('>IIBBBBB', width, height, 8, 0 if channels == 1 else 2, 0, 0, 0)
    with open(path, 'wb') as file:
        file.write(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) +
                   chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b''))


def boxes(data, begin, end):
    while begin < end:
        size, kind = struct.unpack('>I4s', data[begin:begin + 8])
        yield kind, begin + 8, begin + size
        begin += size


def find(data, begin, end, kind):
    return next((b, e) for k, b, e in boxes(data, begin, end) if k == kind)


def item_of(data):
    """The properties and the bitstream of the only image of a file of heif-enc."""
    meta, meta_end = find(data, 0, len(data), b'meta')
    meta += 4
    iprp = find(data, meta, meta_end, b'iprp')
    ipco = find(data, *iprp, b'ipco')
    properties = [data[b - 8:e] for k, b, e in boxes(data, *ipco) if k in (b'hvcC', b'ispe', b'pixi', b'colr')]
    iloc, _ = find(data, meta, meta_end, b'iloc')
    version, sizes, base = data[iloc], data[iloc + 4], data[iloc + 5] >> 4
    assert version == 0 and sizes == 0x44 and struct.unpack('>H', data[iloc + 6:iloc + 8])[0] == 1
    at = iloc + 8 + 4 + base
    extents = struct.unpack('>H', data[at:at + 2])[0]
    assert extents == 1
    offset, length = struct.unpack('>II', data[at + 2:at + 10])
    if base == 4:
        offset += struct.unpack('>I', data[iloc + 12:iloc + 16])[0]
    return properties, data[offset:offset + length]


def box(kind, *parts):
    body = b''.join(parts)
    return struct.pack('>I4s', 8 + len(body), kind) + body


def full(kind, version, flags, *parts):
    return box(kind, struct.pack('>I', version << 24 | flags), *parts)


def heic(photo, depth, xmp, turned=False):
    (photo_properties, photo_data), (depth_properties, depth_data) = photo, depth
    properties = list(photo_properties) + list(depth_properties)
    properties.append(full(b'auxC', 0, 0, b'urn:mpeg:hevc:2015:auxid:2\0'))
    depth_links = list(range(len(photo_properties) + 1, len(properties) + 1))
    photo_links = list(range(1, len(photo_properties) + 1))
    if turned:  # both, as the cameras do
        properties.append(box(b'irot', b'\x03'))
        photo_links.append(len(properties))
        depth_links.append(len(properties))
    def links(item, numbers):
        return struct.pack('>HB', item, len(numbers)) + bytes(numbers)
    def infe(item, kind, *rest):
        return full(b'infe', 2, 0, struct.pack('>HH4s', item, 0, kind), b'\0', *rest)
    def reference(kind, source, target):
        return box(kind, struct.pack('>HHH', source, 1, target))
    items = [photo_data, depth_data] + ([xmp] if xmp is not None else [])
    def meta(offsets):
        entries = [infe(1, b'hvc1'), infe(2, b'hvc1')]
        references = [reference(b'auxl', 2, 1)]
        if xmp is not None:
            entries.append(infe(3, b'mime', b'application/rdf+xml\0'))
            references.append(reference(b'cdsc', 3, 2))
        iloc = struct.pack('>BBH', 0x44, 0, len(items)) + b''.join(
            struct.pack('>HHHII', i + 1, 0, 1, offsets[i], len(item)) for i, item in enumerate(items))
        return full(
            b'meta', 0, 0,
            full(b'hdlr', 0, 0, b'\0' * 4, b'pict', b'\0' * 13),
            full(b'pitm', 0, 0, struct.pack('>H', 1)),
            full(b'iloc', 0, 0, iloc),
            full(b'iinf', 0, 0, struct.pack('>H', len(entries)), *entries),
            full(b'iref', 0, 0, *references),
            box(b'iprp', box(b'ipco', *properties),
                full(b'ipma', 0, 0, struct.pack('>I', 2), links(1, photo_links),
                     links(2, depth_links))))
    ftyp = box(b'ftyp', b'heic', b'\0' * 4, b'mif1heic')
    at = len(ftyp) + len(meta([0] * len(items))) + 8
    offsets = []
    for item in items:
        offsets.append(at)
        at += len(item)
    return ftyp + meta(offsets) + box(b'mdat', *items)


XMP = '''<x:xmpmeta xmlns:x="adobe:ns:meta/" x:xmptk="XMP Core 5.4.0">
   <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
      <rdf:Description rdf:about=""
            xmlns:apdi="http://ns.apple.com/pixeldatainfo/1.0/"
            xmlns:depthData="http://ns.apple.com/depthData/1.0/">
         <apdi:NativeFormat>{native}</apdi:NativeFormat>
         <apdi:StoredFormat>1278226488</apdi:StoredFormat>
         <apdi:AuxiliaryImageType>{kind}</apdi:AuxiliaryImageType>
         <apdi:IntMinValue>0</apdi:IntMinValue>
         <apdi:IntMaxValue>255</apdi:IntMaxValue>
         <apdi:FloatMinValue>{low}</apdi:FloatMinValue>
         <apdi:FloatMaxValue>{high}</apdi:FloatMaxValue>
         <depthData:DepthDataVersion>65541</depthData:DepthDataVersion>
         <depthData:Accuracy>{accuracy}</depthData:Accuracy>
      </rdf:Description>
   </rdf:RDF>
</x:xmpmeta>
'''


CONTAINER = '''<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about=""
    xmlns:Container="http://ns.google.com/photos/1.0/container/"
    xmlns:Item="http://ns.google.com/photos/1.0/container/item/"
    xmlns:GDepth="http://ns.google.com/photos/1.0/depthmap/"
    GDepth:Format="RangeInverse" GDepth:Near="0.5" GDepth:Far="4" GDepth:Units="m">
   <Container:Directory>
    <rdf:Seq>
     <rdf:li rdf:parseType="Resource">
      <Container:Item Item:Mime="image/jpeg" Item:Semantic="Primary"/>
     </rdf:li>
     <rdf:li rdf:parseType="Resource">
      <Container:Item Item:Mime="image/jpeg" Item:Semantic="GainMap" Item:Length="{gain}"/>
     </rdf:li>
     <rdf:li rdf:parseType="Resource">
      <Container:Item Item:Mime="image/png" Item:Semantic="Depth" Item:Length="{depth}"/>
     </rdf:li>
    </rdf:Seq>
   </Container:Directory>
  </rdf:Description>
 </rdf:RDF>
</x:xmpmeta>
'''


def run(*words):
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)


def read(path):
    with open(path, 'rb') as file:
        return file.read()


def write(name, data):
    with open(os.path.join(HERE, name), 'wb') as file:
        file.write(data)


def tagged(photo, folder, *tags):
    """The photograph with tags of exiftool."""
    path = os.path.join(folder, 'tagged.jpg')
    with open(path, 'wb') as file:
        file.write(photo)
    run('exiftool', '-q', '-overwrite_original', '-n', *tags, path)
    return read(path)


def with_index(photo, image, kind):
    """The photograph with an index of two images, and the second one behind it."""
    def entries(photo_bytes, begin):
        return (struct.pack('>IIIHH', 0x030000, photo_bytes, 0, 0, 0) +
                struct.pack('>IIIHH', kind, len(image), begin, 0, 0))
    def index(photo_bytes, begin):
        directory = struct.pack('>H', 3)
        directory += struct.pack('>HHI4s', 0xB000, 7, 4, b'0100')
        directory += struct.pack('>HHII', 0xB001, 4, 1, 2)
        directory += struct.pack('>HHII', 0xB002, 7, 32, 8 + 2 + 3 * 12 + 4)
        body = b'MPF\0MM\0*' + struct.pack('>I', 8) + directory + b'\0' * 4
        body += entries(photo_bytes, begin)
        return b'\xFF\xE2' + struct.pack('>H', 2 + len(body)) + body
    size = len(photo) + len(index(0, 0))
    # Offsets count from the header of the index, 8 bytes behind the marker, which follows the
    # first two bytes of the file.
    return photo[:2] + index(size, size - 10) + photo[2:] + image


def make_jpegs(folder):
    path = lambda name: os.path.join(folder, name)
    png(path('photo.png'), 64, 48, 3, lambda x, y: (4 * x, 5 * y, 90))
    png(path('halves.png'), 32, 24, 1, lambda x, y: (51 if x < 16 else 255,))
    png(path('large.png'), 256, 192, 1, lambda x, y: ((37 * x + 101 * y) % 256,))
    run('convert', path('photo.png'), '-quality', '75', path('photo.jpg'))
    run('convert', path('photo.png'), '-resize', '16x12!', '-quality', '75', path('small.jpg'))
    run('convert', path('halves.png'), '-quality', '95', path('halves.jpg'))
    # 256 levels in no order cannot be compressed to less than a segment of 64 KiB of base64.
    run('convert', path('large.png'), '-define', 'png:compression-level=0', path('large_stored.png'))
    photo, depth, small = (read(path(name)) for name in ('photo.jpg', 'halves.png', 'small.jpg'))
    write('gdepth_inverse.jpg', tagged(
        photo, folder, '-XMP-GDepth:Format=RangeInverse', '-XMP-GDepth:Near=0.4',
        '-XMP-GDepth:Far=2.5', '-XMP-GDepth:Units=m', '-XMP-GDepth:Mime=image/png',
        '-XMP-GDepth:DepthImage<=' + path('halves.png')))
    write('gdepth_linear_ray.jpg', tagged(
        photo, folder, '-XMP-GDepth:Format=RangeLinear', '-XMP-GDepth:Near=300',
        '-XMP-GDepth:Far=900', '-XMP-GDepth:Units=mm', '-XMP-GDepth:MeasureType=OpticRay',
        '-XMP-GDepth:Mime=image/jpeg', '-XMP-GDepth:DepthImage<=' + path('halves.jpg')))
    write('gdepth_extended.jpg', tagged(
        photo, folder, '-XMP-GDepth:Format=RangeInverse', '-XMP-GDepth:Near=0.4',
        '-XMP-GDepth:Far=2.5', '-XMP-GDepth:Mime=image/png',
        '-XMP-GDepth:DepthImage<=' + path('large_stored.png')))
    write('dynamic_depth.jpg', tagged(
        photo, folder,
        '-XMP-Device:Container={Directory=[{Item={Mime=image/jpeg,Length=0,Padding=0,'
        'DataURI=primary_image}},{Item={Mime=image/png,Length=%d,DataURI=android/depthmap}}]}' %
        len(depth),
        '-XMP-Device:Cameras=[{Camera={DepthMap={Format=RangeLinear,Near=1,Far=3,Units=Meters,'
        'DepthURI=android/depthmap,ItemSemantic=Depth}}}]') + depth)
    with open(path('container.xmp'), 'w') as file:
        file.write(CONTAINER.format(gain=len(small), depth=len(depth)))
    write('container_depth.jpg',
          tagged(photo, folder, '-XMP<=' + path('container.xmp')) + small + depth)
    with open(path('apple.xmp'), 'w') as file:
        file.write(XMP.format(kind='disparity', native=1751411059, low=0.5, high=3.05,
                              accuracy='absolute'))
    disparity = tagged(read(path('halves.jpg')), folder, '-XMP<=' + path('apple.xmp'))
    write('apple_disparity.jpg', with_index(photo, disparity, 0))
    write('second_image.jpg', with_index(photo, small, 0))
    write('stereo_pair.jpg', with_index(photo, small, 0x020002))


def make_heics(folder):
    path = lambda name: os.path.join(folder, name)
    png(path('photo.png'), WIDTH, HEIGHT, 3, lambda x, y: (x, 2 * y, 90))
    # The upper 16 rows are 255; below, the left half is 40, the right half 200.
    png(path('depth.png'), SMALL_WIDTH, SMALL_HEIGHT, 1,
        lambda x, y: (40 if x < 64 else 200,) if y >= 16 else (255,))
    run('heif-enc', '-q', '30', path('photo.png'), '-o', path('photo.heic'))
    run('heif-enc', '-L', path('depth.png'), '-o', path('depth.heic'))
    photo, depth = (item_of(read(path(name))) for name in ('photo.heic', 'depth.heic'))
    def described(kind, native, low, high, accuracy):
        return XMP.format(kind=kind, native=native, low=low, high=high, accuracy=accuracy).encode()
    write('apple_disparity.heic',
          heic(photo, depth, described('disparity', 1751411059, 0.5, 3.05, 'absolute'), True))
    write('apple_depth.heic', heic(photo, depth, described('depth', 1717855600, 1, 3.55, 'relative')))
    write('apple_wrong_range.heic',
          heic(photo, depth, described('disparity', 1751411059, 3, 0.5, 'absolute')))
    write('depth_without_xmp.heic', heic(photo, depth, None))


with tempfile.TemporaryDirectory() as scratch:
    make_jpegs(scratch)
    make_heics(scratch)
