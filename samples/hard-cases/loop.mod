MODULE Loop
  CONST num nPitch:=12.5;
  CONST robtarget pRow{3}:=[[[0,0,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[0,20,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[0,40,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
  PROC main()
    VAR num nDepth:=-1;
    FOR row FROM 1 TO Dim(pRow,1) DO
      MoveL pRow{row},v20,fine,tMill\WObj:=wPart;
      FOR i FROM 1 TO 4 DO
        IF i<=3 MoveL Offs(pRow{row},i*nPitch,0,nDepth+1),v20,fine,tMill\WObj:=wPart;
      ENDFOR
    ENDFOR
    WHILE nDepth>-3 DO
      MoveL [[60,50,0],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,fine,tMill\WObj:=wPart;
      nDepth:=nDepth-1;
    ENDWHILE
  ENDPROC
ENDMODULE
