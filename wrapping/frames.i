// The list of transforms as one property, so that `transforms=[...]` can be given where the filter is made or called.

%define SHEAR_WARP_MIP_SET_TRANSFORMS(class)
%extend class {
%pythoncode %{
    def SetTransforms(self, transforms):
        """Makes each of these transforms, from view space to physical space, a frame."""
        self.ClearTransforms()
        for transform in transforms:
            self.AddTransform(transform)
%}
}
%enddef
