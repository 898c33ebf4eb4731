from pteron.viewer.view import Viewer as Viewer, view as view
