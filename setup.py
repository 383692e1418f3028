"""The Python module, for catkin_python_setup() alone: it is built and installed by CMake."""
from setuptools import setup

from catkin_pkg.python_setup import generate_distutils_setup

setup(**generate_distutils_setup(packages=['meshless_surgery'], package_dir={'': 'python'}))
