"""Casts rays through a volume with VTK: SCENE.json OUT_PREFIX; for each sample distance writes the picture as raw RGB and prints its milliseconds."""

import json
import sys
import time

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy


def volume_of(scene):
    data = np.fromfile(scene["volume"], dtype="<i2")
    image = vtk.vtkImageData()
    image.SetDimensions(scene["dims"])
    image.SetSpacing([scene["spacing_mm"]] * 3)
    image.SetOrigin(scene["origin"])
    # The mapper looks its colours up by whole numbers from zero.
    array = numpy_to_vtk((data + 1024).clip(0).astype(np.uint16), deep=True, array_type=vtk.VTK_UNSIGNED_SHORT)
    image.GetPointData().SetScalars(array)
    return image


def scene_of(scene, image):
    """The isosurface as a step of opacity, shaded by gradients."""
    iso = scene["isovalue"] + 1024
    mapper = vtk.vtkFixedPointVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.AutoAdjustSampleDistancesOff()
    mapper.SetImageSampleDistance(1.0)
    opacity = vtk.vtkPiecewiseFunction()
    opacity.AddPoint(iso - 0.5, 0.0)
    opacity.AddPoint(iso + 0.5, 1.0)
    colour = vtk.vtkColorTransferFunction()
    colour.AddRGBPoint(0.0, 0.9, 0.85, 0.75)
    look = vtk.vtkVolumeProperty()
    look.SetScalarOpacity(opacity)
    look.SetColor(colour)
    look.SetInterpolationTypeToLinear()
    look.ShadeOn()
    volume = vtk.vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(look)
    renderer = vtk.vtkRenderer()
    renderer.AddVolume(volume)
    renderer.SetBackground(0.1, 0.12, 0.15)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(scene["eye"])
    camera.SetFocalPoint(scene["target"])
    camera.SetViewUp(scene["up"])
    camera.SetViewAngle(scene["fov_deg"])
    renderer.ResetCameraClippingRange()
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(scene["size"])
    window.AddRenderer(renderer)
    return mapper, renderer, window


def picture(window):
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    out = grab.GetOutput()
    width, height, _ = out.GetDimensions()
    return vtk_to_numpy(out.GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, :3]


def main():
    with open(sys.argv[1]) as file:
        scene = json.load(file)
    mapper, renderer, window = scene_of(scene, volume_of(scene))
    window.Render()
    camera = renderer.GetActiveCamera()
    for number, step in enumerate(scene["steps_voxel"]):
        mapper.SetSampleDistance(step * scene["spacing_mm"])
        window.Render()
        times = []
        for turn in range(scene["repeats"]):
            # Each picture moves the camera; the last one is seen from where the first was.
            camera.Azimuth(0.5 if turn % 2 == 0 else -0.5)
            start = time.perf_counter()
            window.Render()
            times.append(1e3 * (time.perf_counter() - start))
        picture(window).astype(np.uint8).tofile(f"{sys.argv[2]}{number}.rgb")
        print(f"ms {step} {np.median(times):.3f}")
    print(f"version {vtk.vtkVersion.GetVTKVersion()}, {mapper.GetNumberOfThreads()} threads, {window.GetClassName()}")


main()
