//! What `export --help` says of its forms.

pub(super) const EXAMPLE: &str = "\
Example:
  calib-offline export rig.rays -o rig.hex --format hex --base-address 0x08100000
  calib-offline export rig.rays -o rig.uf2 --format uf2 --base-address 0x10100000 --family rp2040
  calib-offline export rig.rays -o rig.c --format c --name rig_blob
  calib-offline export rig.rays -o slot.hex --format slot-image --part stm32h743 --region-address 0x08120000 --region-size 0xe0000 --serial SN-0012
  calib-offline export calibration.json -o opencv --format opencv
  calib-offline export calibration.json -o fisheye --format kalibr --model equidistant --distance-mm 800
  calib-offline export calibration.json -o flat --format undistort --images recordings/monday
  calib-offline export calibration.json -o ldc --format mesh-ti --step 8 --camera left
  calib-offline export points.csv -o points.ply --format ply";

pub(super) const FORMATS: &str = "\
hex, uf2, bin and c take a blob and write one file. The base address is where it goes in the device's memory: a
multiple of 8, of 256 for uf2, whose last page is filled up with 0xff. The boot ROMs of the RP2040 and the RP2350 erase whole
sectors and leave files without a family alone: there it is a multiple of 4096, the last sector is filled up, and
--family is required (rp2040, rp2350-arm-s, rp2350-riscv; data or absolute beside a partition table). Some readers, such as
Nordic's nrf-intel-hex, refuse HEX from 0x80000000 on, where external flash of many parts is: take bin there, and give the tool the address.
The C source defines an array, aligned to 8, and its length NAME_len (ray-runtime/c/rays.h opens it). docs/FLASHING.md has
the commands of flash tools. An earlier file of the same form is replaced; any other only with --force.

slot-image is what a production line writes, so that a device with the storage of ray-device starts with the blob: its
slot with a sealed commit record, made by the device's own code for the unit, block and erased value of --part (or --unit, --block,
--erased). They, --region-address and --region-size are those that the device's firmware hands to the storage; the rest of that
region has to be blank. With --serial a factory record says that the device has the blob's cameras. --container hex holds only
what is programmed, which parts with ECC need; bin and uf2 (with --family) hold the blank bytes between, too. A device whose flash
driver has another unit says that the slot is for another part (code 128).

The others take a blob or a calibration.json and write a folder; files in it are replaced only with --force.
opencv  NAME.yml a camera and extrinsics.yml (R, T: the second camera from the first, mm)
ros     NAME.yaml a camera (camera_info); where the cameras stand is lost
kalibr  camchain.yaml, in meters
mrcal, mrcal-splined
        NAME.cameramodel, in meters, in the rig's frame: LENSMODEL_OPENCV4, 5 or 8; splined stereographic
remap   maps of each camera's undistorted view, for cv::remap: map_NAME.npy (float), fixed_NAME.npy and
        fraction_NAME.npy (whole numbers), mask_NAME.npy, and remap.json. -1 where no ray goes
rectify the same for both cameras of a rectified pair, with R1, R2, P1, P2, Q in rectify.json and rectify.yml
undistort
        the PNG images of --images, each of the camera that its name begins with, and mask_NAME.png
npy     rays_NAME.npy a camera, as --ray-tables of calibrate writes them, mask_NAME.npy, the uncertainty of pairs
        where a calibration has it, and rays.json: shapes and units
The first five hold the lenses that come nearest to the rays of the calibrated area (--region: of a part) at the
working distance (or --distance-mm): pinholes with 5 coefficients, or with 8 where these lose a fifth less (kalibr: 4),
or what --model says. remap, rectify and undistort are exact for a plane at that distance across the
view. What is lost is printed and written to FOLDER.loss.json, for lenses with a map over each sensor.

Meshes undistort in a chip: for nodes of the output image, --step px apart, the pixel of the camera's image. The output image
is that of the nearest pinhole without distortion, of the sensor's size, and shows what lies --distance-mm away. With each comes
mesh.json: its camera matrix and place, and what the chip has to be told.
mesh-ti       ldc_NAME.bin for TI's LDC (1/8 px; step 1 to 128, a power of two [16])
mesh-dw100    dw100_NAME.bin for NXP's DW100 (1/16 px; step 16)
mesh-vpi      vpi_NAME.f32 for NVIDIA's VPI (step 1 to 64, a power of two [1])
mesh-luxonis  NAME_mesh.calib for Luxonis' StereoDepth, two cameras as a rectified pair (step [16] divides the size)
mesh          mesh_NAME.npy, bilinear (any step [16])
None was tried on its chip. The loss is that of its arithmetic, emulated, rounded at its worst: over all pixels of the output image that show
something calibrated. Where they do not, the mesh goes straight on, and their number is printed.

ply takes the points.csv of measure instead of a rig and writes one file: x y z, gap and sigma, binary doubles.

With --json, schema calib-offline/export/1:
  output, format
  file_bytes    of all files
  blob_bytes, base_address, family, name    null where the form has none
  files    those of a folder; else null
  loss (rms_px, max_px, rms_mm, max_mm, distance_mm,
    cameras (name, model, coefficients, rms_px, max_px, rms_mm, max_mm,
      output_pixels, outside_pixels, held_back_nodes))    of lenses, of views at half and at twice the
    distance, and of meshes; else null. model and coefficients only of lenses, the last three only of meshes:
    held_back_nodes lay beyond the format's integers. FOLDER.loss.json of lenses has maps too
    (camera, rotation, translation_mm, u_px, v_px, du_px, dv_px, mm)    rig from lens; by row and
    column, null where there is no ray
  points (count, left_out, has_sigma)    of ply; else null
  slot (container, slot, unit, block, erased, region_address, region_size, blob_address, programmed_bytes,
    has_factory_record)    of slot-image, whose base_address is that of the first byte; else null";
