MODULE Signs
  ! The same orientation, its quaternion's sign flipped from target to target.
  PROC main()
    MoveL [[0,0,0],[0,0.99984770,0,-0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[10,0,0],[0,-0.99984770,0,0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[20,0,0],[0,0.99984770,0,-0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[30,0,0],[0,-0.99984770,0,0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[40,0,0],[0,0.99984770,0,-0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
    MoveL [[50,0,0],[0,-0.99984770,0,0.01745241],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
  ENDPROC
ENDMODULE
