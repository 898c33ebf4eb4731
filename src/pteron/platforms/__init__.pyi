from pteron.platforms.motion import PlatformEquations as PlatformEquations
from pteron.platforms.parts import Bar as Bar, GearedPart as GearedPart
from pteron.platforms.platform import Platform as Platform
