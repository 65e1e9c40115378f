// Among the filters for an input, ITK makes the one whose output has the input's type. Here this output is a slice in
// physical space: it must be asked for.

%pythoncode %{
from itk.support.template_class import itkTemplate


class _ShearWarpMIPTemplate(itkTemplate):
    """Makes a filter with an output of dimension 2 unless `ttype` asks for another."""

    def New(self, *args, **kwargs):
        if "ttype" in kwargs:
            return super().New(*args, **kwargs)
        flat = object.__new__(itkTemplate)
        flat.__local__init__(self.__name__)
        flat.__template__.update(item for item in self.items() if item[0][0] is not item[0][1])
        return flat.New(*args, **kwargs)

    New.__doc__ = itkTemplate.New.__doc__


# ITK finds it by its name
_ShearWarpMIPTemplate("itk::ShearWarpMIPImageFilter")
%}
